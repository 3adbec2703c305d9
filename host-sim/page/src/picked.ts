// Card with the values of what is selected in the picture.
import { button, element, setText } from "./dom.ts";
import type { Readout } from "./picker.ts";

/** Fills `root`, which is hidden while nothing is selected. */
export class PickedCard {
  private readonly title = element("h2");
  private readonly list = element("dl");

  constructor(
    private readonly root: HTMLElement,
    close: () => void,
  ) {
    const shut = button("×", close, { "aria-label": "Close", title: "Close (Esc)" });
    root.append(element("div", { class: "plot-title" }, this.title, shut), this.list);
  }

  show(readout: Readout | null): void {
    this.root.hidden = readout === null;
    if (!readout) {
      return;
    }
    setText(this.title, readout.title);
    // Rebuild the rows for another selection, otherwise change their values only.
    const labels = [...this.list.querySelectorAll("dt")].map((label) => label.textContent);
    if (labels.join() !== readout.rows.map(([label]) => label).join()) {
      this.list.replaceChildren(...readout.rows.flatMap(([label]) => [element("dt", {}, label), element("dd")]));
    }
    this.list.querySelectorAll("dd").forEach((value, k) => setText(value, readout.rows[k]![1]));
  }
}
