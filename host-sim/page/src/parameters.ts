// Parameter controls: a slider and a number field per parameter, or a list for a choice.
import type { Actions } from "./actions.ts";
import { element, throttle } from "./dom.ts";
import type { Parameter } from "./protocol.ts";
import { sliderPosition, rounded, valueAtPosition, formatNumber } from "./scale.ts";

const sendInterval = 50; // ms, while a slider moves
const echoDelay = 500; // ms after a change before values from host-sim are shown again

/** Shows a value unless its control is in use. */
type ShowValue = (value: number) => void;

/** The controls of all parameters of a scene. */
export class Parameters {
  readonly root = element("div", { class: "rows" });
  private showValues: ShowValue[] = [];

  constructor(private readonly actions: Actions) {}

  show(parameters: Parameter[]): void {
    this.root.replaceChildren();
    this.showValues = parameters.map((parameter) =>
      parameter.choices.length > 0 ? this.addChoice(parameter) : this.addSlider(parameter),
    );
  }

  /** In the order of the scene's parameters. */
  update(values: Float32Array): void {
    this.showValues.forEach((showValue, i) => {
      const value = values[i];
      if (value !== undefined) {
        showValue(value);
      }
    });
  }

  private addChoice(parameter: Parameter): ShowValue {
    const select = element("select");
    parameter.choices.forEach((choice, i) => select.append(element("option", { value: i }, choice.replace(/_/g, " "))));
    let changed = -Infinity;
    select.addEventListener("change", () => {
      changed = performance.now();
      this.actions.send({ type: "set", key: parameter.key, value: Number(select.value) });
    });
    this.root.append(element("label", { class: "row", title: parameter.meaning }, parameter.label, select));
    return (value) => {
      if (performance.now() - changed > echoDelay) {
        select.value = String(Math.round(value));
      }
    };
  }

  private addSlider(parameter: Parameter): ShowValue {
    // Label, number field and slider of the parameter.
    const id = `parameter-${parameter.key.replace(/\W/g, "-")}`;
    const label = element("label", { for: id, title: parameter.meaning }, parameter.label);
    const { least, most, unit } = parameter;
    const field = element("input", { id, type: "number", min: least, max: most, step: parameter.whole ? 1 : "any" });
    const slider = element("input", { type: "range", min: 0, max: 1, step: "any", "aria-label": parameter.label });
    slider.title = `${formatNumber(least)} to ${formatNumber(most)} ${unit}`.trim();
    // Every change goes to host-sim; the slider maps its position through the parameter's scale.
    const send = throttle(sendInterval, (value: number) =>
      this.actions.send({ type: "set", key: parameter.key, value }),
    );
    let changed = -Infinity;
    const change = (value: number): void => {
      changed = performance.now();
      slider.setAttribute("aria-valuetext", `${formatNumber(value)} ${unit}`);
      send(value);
    };
    slider.addEventListener("input", () => {
      const value = valueAtPosition(parameter, slider.valueAsNumber);
      field.value = formatNumber(value);
      change(value);
    });
    stepByKeys(slider, parameter);
    field.addEventListener("change", () => {
      if (Number.isFinite(field.valueAsNumber)) {
        const value = Math.min(Math.max(field.valueAsNumber, least), most);
        field.value = formatNumber(value, 6);
        slider.valueAsNumber = sliderPosition(parameter, value);
        change(value);
      }
    });
    // Values from host-sim are shown, except shortly after a change and while the field is edited.
    const sized = element("span", { class: "number" }, field, element("span", { class: "unit" }, unit));
    this.root.append(element("div", { class: "parameter" }, label, sized, slider));
    return (value) => {
      if (performance.now() - changed > echoDelay) {
        slider.valueAsNumber = sliderPosition(parameter, value);
        slider.setAttribute("aria-valuetext", `${formatNumber(value)} ${unit}`);
        if (document.activeElement !== field) {
          field.value = formatNumber(value);
        }
      }
    };
  }
}

/** Arrow keys on a slider without steps: one for integers, otherwise a hundredth of the range. */
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
    const position = slider.valueAsNumber;
    const value = valueAtPosition(parameter, position);
    slider.valueAsNumber = parameter.whole
      ? sliderPosition(parameter, rounded(parameter, value + steps))
      : position + steps / 100;
    slider.dispatchEvent(new Event("input"));
  });
}
