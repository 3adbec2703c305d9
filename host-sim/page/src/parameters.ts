// The parameters of a scene: a slider and a field for each, or a list where there are choices.
import type { Actions } from "./actions.ts";
import { element, paced } from "./dom.ts";
import type { Parameter } from "./protocol.ts";
import { placeOf, rounded, valueAt, written } from "./scale.ts";

const sendEvery = 50; // ms, while a slider moves
const settles = 500; // ms after a change, until what host-sim says of it is shown again

/** Shows a value unless its control is being moved. */
type Follow = (value: number) => void;

/** The controls of all parameters of a scene. */
export class Parameters {
  readonly root = element("div", { class: "rows" });
  private follows: Follow[] = [];

  constructor(private readonly actions: Actions) {}

  show(parameters: Parameter[]): void {
    this.root.replaceChildren();
    this.follows = parameters.map((parameter) =>
      parameter.choices.length > 0 ? this.addChoice(parameter) : this.addSlider(parameter),
    );
  }

  /** In the order of the scene's parameters. */
  follow(values: Float32Array): void {
    this.follows.forEach((follow, i) => {
      const value = values[i];
      if (value !== undefined) {
        follow(value);
      }
    });
  }

  private addChoice(parameter: Parameter): Follow {
    const select = element("select");
    parameter.choices.forEach((choice, i) => select.append(element("option", { value: i }, choice.replace(/_/g, " "))));
    let changed = -Infinity;
    select.addEventListener("change", () => {
      changed = performance.now();
      this.actions.send({ type: "set", key: parameter.key, value: Number(select.value) });
    });
    this.root.append(element("label", { class: "row" }, parameter.label, select));
    return (value) => {
      if (performance.now() - changed > settles) {
        select.value = String(Math.round(value));
      }
    };
  }

  private addSlider(parameter: Parameter): Follow {
    const id = `parameter-${parameter.key.replace(/\W/g, "-")}`;
    const label = element("label", { for: id }, parameter.label);
    const { least, most, unit } = parameter;
    const field = element("input", { id, type: "number", min: least, max: most, step: parameter.whole ? 1 : "any" });
    const slider = element("input", { type: "range", min: 0, max: 1, step: "any", "aria-label": parameter.label });
    slider.title = `${written(least)} to ${written(most)} ${unit}`.trim();
    const send = paced(sendEvery, (value: number) => this.actions.send({ type: "set", key: parameter.key, value }));
    let changed = -Infinity;
    const change = (value: number): void => {
      changed = performance.now();
      slider.setAttribute("aria-valuetext", `${written(value)} ${unit}`);
      send(value);
    };
    slider.addEventListener("input", () => {
      const value = valueAt(parameter, slider.valueAsNumber);
      field.value = written(value);
      change(value);
    });
    stepByKeys(slider, parameter);
    field.addEventListener("change", () => {
      if (Number.isFinite(field.valueAsNumber)) {
        const value = Math.min(Math.max(field.valueAsNumber, least), most);
        field.value = written(value, 6);
        slider.valueAsNumber = placeOf(parameter, value);
        change(value);
      }
    });
    const sized = element("span", { class: "number" }, field, element("span", { class: "unit" }, unit));
    this.root.append(element("div", { class: "parameter" }, label, sized, slider));
    return (value) => {
      if (performance.now() - changed > settles) {
        slider.valueAsNumber = placeOf(parameter, value);
        slider.setAttribute("aria-valuetext", `${written(value)} ${unit}`);
        if (document.activeElement !== field) {
          field.value = written(value);
        }
      }
    };
  }
}

/** Arrows on a slider without steps: one for whole numbers, else a hundredth of the way. */
function stepByKeys(slider: HTMLInputElement, parameter: Parameter): void {
  const signs: Record<string, number> = {
    ArrowRight: 1,
    ArrowUp: 1,
    ArrowLeft: -1,
    ArrowDown: -1,
    PageUp: 10,
    PageDown: -10,
  };
  slider.addEventListener("keydown", (event) => {
    const steps = signs[event.key];
    if (steps === undefined || slider.disabled) {
      return;
    }
    event.preventDefault();
    const place = slider.valueAsNumber;
    const value = valueAt(parameter, place);
    slider.valueAsNumber = parameter.whole
      ? placeOf(parameter, rounded(parameter, value + steps))
      : place + steps / 100;
    slider.dispatchEvent(new Event("input"));
  });
}
