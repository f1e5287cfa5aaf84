"""Look and behaviour of ``report.html``: light, dark, phone, paper; tables that sort by click."""

STYLE = """
:root { color-scheme: light dark; --ink: #1c2024; --soft: #5b6068; --line: #d9dce1; --page: #fff;
  --card: #f5f6f8; --good: #00734f; --bad: #b3400c; --link: #0b61a4 }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8eb; --soft: #a3a9b1; --line: #363a41;
  --page: #15171a; --card: #1f2226; --good: #3ecf9b; --bad: #ff8a50; --link: #6cb6ff } }
* { box-sizing: border-box }
body { margin: 0 auto; padding: 1.5rem; max-width: 72rem; background: var(--page);
  color: var(--ink); font: 15px/1.5 system-ui, sans-serif; overflow-wrap: break-word }
h1 { font-size: 1.5rem; margin: 0 } h2 { font-size: 1.1rem; margin: 2.2rem 0 .6rem }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem }
a { color: var(--link) }
.soft { color: var(--soft) } .good { color: var(--good) } .bad { color: var(--bad) }
.cards { display: flex; flex-wrap: wrap; gap: .8rem; margin: 1.2rem 0 }
.card { background: var(--card); border-radius: .5rem; padding: .7rem 1rem; min-width: 9rem }
.card b { display: block; font-size: 1.4rem }
.scroll { overflow-x: auto; max-height: 46rem; overflow-y: auto }
table { border-collapse: collapse; width: 100%; font-size: .87rem;
  font-variant-numeric: tabular-nums }
th, td { padding: .25rem .6rem; border-bottom: 1px solid var(--line); text-align: right;
  white-space: nowrap }
th { color: var(--soft); font-weight: 600; white-space: normal; background: var(--page);
  position: sticky; top: 0 }
th:first-child, td:first-child, .words th, .words td { text-align: left }
.words td { white-space: normal }
td:first-child { position: sticky; left: 0; background: var(--page) }
th button { all: unset; cursor: pointer } th button:focus-visible { outline: 2px solid var(--link) }
th button::after { content: " \\2195"; opacity: .45 }
th[aria-sort=ascending] button::after { content: " \\2191"; opacity: 1 }
th[aria-sort=descending] button::after { content: " \\2193"; opacity: 1 }
figure { margin: 0 0 1rem } figure svg { width: 100%; height: auto; display: block }
figure svg text { fill: var(--soft) !important }
figure video { max-width: 100%; max-height: 32rem; border-radius: .5rem; display: block }
figcaption { color: var(--soft); font-size: .85rem; max-width: 50rem }
.pair { display: grid; gap: 1rem;
  grid-template-columns: repeat(auto-fit, minmax(min(26rem, 100%), 1fr)) }
.pair figure { max-width: 38rem }
.key span { display: inline-block; width: .8em; height: .8em; border-radius: .2em; opacity: .6;
  margin: 0 .3em 0 1em }
pre { background: var(--card); padding: .8rem; overflow-x: auto; font-size: .8rem }
@media (max-width: 40rem) { body { padding: .8rem; font-size: 14px } .wide { overflow-x: auto }
  .wide svg { min-width: 42rem } .card { flex: 1 1 8rem; min-width: 8rem; padding: .5rem .7rem }
  .card b { font-size: 1.15rem } th, td { padding: .25rem .4rem } ul { padding-left: 1.1rem } }
@media print { :root { color-scheme: light; --ink: #000; --soft: #444; --line: #bbb; --page: #fff;
  --card: #f2f2f2; --good: #00593d; --bad: #8f3309; --link: #000 }
  @page { margin: 14mm } body { max-width: none; padding: 0; font-size: 10.5pt }
  .screen, th button::after { display: none } .pair { grid-template-columns: 1fr 1fr }
  .scroll { overflow: visible; max-height: none } table { font-size: 8pt }
  th, td { padding: .1rem .3rem } th, td:first-child { position: static }
  thead { display: table-header-group }
  figure, tr, .card { break-inside: avoid } h2, h3 { break-after: avoid }
  .card { border: 1px solid var(--line) } }
"""

SORT_SCRIPT = """
for (const table of document.querySelectorAll("table.sortable")) {
  const heads = [...table.tHead.rows[0].cells], body = table.tBodies[0];
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent;
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const way = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      heads.forEach(other => other.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", way > 0 ? "ascending" : "descending");
      const key = row => row.cells[column].dataset.sort;
      const compare = (a, b) => {
        if (a === "" || b === "") return (a === "") - (b === "");
        const x = Number(a), y = Number(b);
        const order = isNaN(x) || isNaN(y) ? a.localeCompare(b, "en", {numeric: true}) : x - y;
        return way * order;
      };
      body.append(...[...body.rows].sort((a, b) => compare(key(a), key(b))));
    });
  });
}
"""
"""What has no value comes last, whichever way is sorted."""
