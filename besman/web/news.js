// What the server of a live page pushes.

/**
 * Have lines of JSON taken as they come, each by the function that is called by its `kind`, and
 * what has changed drawn. `state` is the element that says how the stream is; it says too when what
 * pushes is gone.
 */
export function takeNews(take, draw, state, name) {
  const news = new WebSocket(new URL("news", location.href.replace(/^http/, "ws")));
  news.addEventListener("message", (event) => {
    const one = JSON.parse(event.data);
    take[one.kind]?.(one);
    draw();
  });
  news.addEventListener("close", () => {
    if (!state.textContent.startsWith("ended")) state.textContent = `${name} has ended`;
  });
}
