// What does not work stands at the bottom of the page, with a way to rescue what was done.

/** Show a message, or null when all works again; `content` makes the file to rescue. */
export function showFailure(text, name = "", content = () => "") {
  const element = document.getElementById("failure");
  element.hidden = text === null;
  if (text === null) return;
  const message = document.createElement("span");
  message.textContent = text;
  const button = document.createElement("button");
  button.textContent = "Download my segments";
  button.addEventListener("click", () => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([content()]));
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  });
  element.replaceChildren(message, button);
}
