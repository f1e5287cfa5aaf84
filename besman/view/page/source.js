// Where the page's data come from: its own file, or the server that it was loaded from.

import { fromBase64, unpack } from "./bundle.js";

async function fetched(address) {
  let answer;
  try {
    answer = await fetch(address);
  } catch {
    throw new Error("besman view does not answer any more; start it again.");
  }
  if (!answer.ok) {
    const said = await answer.json().catch(() => ({}));
    throw new Error(said.error || `besman view answers ${answer.status}.`);
  }
  return new Uint8Array(await answer.arrayBuffer());
}

/** Return `overview()` and `demonstration(index)`, which give what besman/view/run_content.py packs. */
export function openSource() {
  const inside = (name) => document.getElementById(name);
  const bytes = inside("overview")
    ? async (name) => fromBase64(inside(name).textContent)
    : fetched;
  const separator = inside("overview") ? "-" : "?index=";
  return {
    overview: async () => unpack(await bytes("overview")),
    demonstration: async (index) => unpack(await bytes(`demonstration${separator}${index}`)),
  };
}
