// The theme of a page: the system's, or the one that was chosen last.

const KEY = "besman-theme";

function stored() {
  try {
    return localStorage.getItem(KEY);
  } catch {
    return null; // Opened from disk, or storage is switched off.
  }
}

/** Return "dark" or "light": what the page shows now. */
export function currentTheme() {
  const chosen = document.documentElement.dataset.theme;
  if (chosen === "dark" || chosen === "light") return chosen;
  return matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light";
}

/**
 * Make a button switch between dark and light.
 * @param {HTMLButtonElement} button
 * @param {() => void} changed called after every change, the system's as well
 */
export function themeToggle(button, changed = () => {}) {
  const before = stored();
  if (before === "dark" || before === "light") document.documentElement.dataset.theme = before;
  const show = () => {
    const other = currentTheme() === "dark" ? "light" : "dark";
    button.textContent = other === "dark" ? "Dark" : "Light";
    button.setAttribute("aria-label", `Switch to the ${other} theme`);
  };
  button.addEventListener("click", () => {
    const theme = currentTheme() === "dark" ? "light" : "dark";
    document.documentElement.dataset.theme = theme;
    try {
      localStorage.setItem(KEY, theme);
    } catch {
      // Then it is not remembered.
    }
    show();
    changed();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    show();
    changed();
  });
  show();
}

/** Return the value of a colour of theme.css, for example color("--person"). */
export function color(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
