// Help dialog: all keys and mouse actions.
import { button, element } from "./dom.ts";
import { optionLabels } from "./options.ts";

const keys: [string, string][] = [
  ["Space", "pause, resume"],
  [".", "a single step"],
  ["R", "restart"],
  ["F, T", "show the whole scene, the tool"],
  ["← → ↑ ↓", "rotate the view; with Shift move it"],
  ["+ −", "nearer, farther"],
  ["H", "move the hand with the arrow keys, Page Up away, Page Down nearer; with Shift rotate it; Esc ends"],
  ["S, V", "save a picture; start a video, end and save it"],
  ["C, P", "show or hide controls, plots"],
  ["?", "this list"],
];

const mouse: [string, string][] = [
  ["Drag", "rotate the view"],
  ["Right drag, Shift drag", "move the view"],
  ["Wheel", "nearer, farther"],
  ["Drag the tool", "move the hand; while dragging, the wheel moves it away or nearer, Shift rotates it"],
  ["Click", "values of a body, a particle or the tool; Esc ends"],
  ["Drop a mesh file", "make a scene of it, to touch it"],
  ["Drag in a plot, wheel", "zoom into a time; a double click follows the run again"],
];

/** Fills the dialog. */
export function createHelp(dialog: HTMLDialogElement): void {
  const options = optionLabels.map(({ key, label }): [string, string] => [key.toUpperCase(), label]);
  dialog.append(
    element("h2", { id: "help-title" }, "Keys and mouse"),
    element("div", { class: "help" }, table("Keys", keys), table("Mouse", mouse), table("Display options", options)),
    button("Close", () => dialog.close(), { autofocus: true }),
  );
  dialog.addEventListener("click", (event) => {
    if (event.target === dialog) {
      dialog.close(); // a click outside the content
    }
  });
}

function table(title: string, rows: [string, string][]): HTMLElement {
  const list = element("dl");
  for (const [key, words] of rows) {
    const named = key.split(", ").flatMap((k, i) => (i > 0 ? [" ", element("kbd", {}, k)] : [element("kbd", {}, k)]));
    list.append(element("dt", {}, ...named), element("dd", {}, words));
  }
  return element("section", {}, element("h3", {}, title), list);
}
