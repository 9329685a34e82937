/** Sliders, chips and trays. */
import { box, button, element, input } from "./elements.ts";

/** A slider with its value in words next to it. */
export class Slider {
  private readonly field: HTMLInputElement;
  private readonly text: HTMLElement;

  constructor(
    id: string,
    private readonly inWords: (value: number) => string,
    changed: (value: number) => void,
  ) {
    this.field = input(id);
    this.text = element(`${id}-value`, HTMLOutputElement);
    this.field.addEventListener("input", () => {
      this.show(this.value);
      changed(this.value);
    });
  }

  get value(): number {
    return this.field.valueAsNumber;
  }

  show(value: number): void {
    if (document.activeElement !== this.field) this.field.value = String(value);
    this.text.textContent = this.inWords(value);
    this.field.setAttribute("aria-valuetext", this.inWords(value));
  }

  enable(is: boolean): void {
    this.field.disabled = !is;
  }
}

export interface Choice {
  readonly name: string;
  readonly label: string;
  /** A small picture in front of the label, by its class. */
  readonly look?: string;
}

/** Chips of which one is chosen; native radio buttons inside, so keys work as everywhere. */
export class Chips {
  constructor(
    private readonly id: string,
    private readonly changed: (name: string) => void,
  ) {}

  show(choices: readonly Choice[], chosen: string | null): void {
    const chips = box(this.id);
    const hadFocus = chips.contains(document.activeElement);
    chips.replaceChildren(...choices.map((choice) => this.made(choice, chosen)));
    if (hadFocus) chips.querySelector<HTMLElement>(":checked")?.focus();
  }

  private made(choice: Choice, chosen: string | null): HTMLElement {
    const chip = document.createElement("label");
    chip.className = "chip";
    const radio = document.createElement("input");
    Object.assign(radio, { type: "radio", name: this.id, value: choice.name, className: "unseen" });
    radio.checked = choice.name === chosen;
    radio.addEventListener("change", () => this.changed(choice.name));
    chip.append(radio);
    if (choice.look) {
      const look = document.createElement("i");
      look.className = choice.look;
      chip.append(look);
    }
    chip.append(choice.label);
    return chip;
  }
}

/**
 * Trays above the tools: at most one is open.
 *
 * @param changed gets the tray that is open now, or null.
 */
export function connectTrays(changed: (open: HTMLElement | null) => void): void {
  const tools = [...document.querySelectorAll<HTMLButtonElement>("[data-tray]")];
  const open = (name: string | null): void => {
    for (const tool of tools) {
      const is = tool.dataset.tray === name;
      tool.setAttribute("aria-expanded", String(is));
      box(`tray-${tool.dataset.tray}`).hidden = !is;
    }
    changed(name ? box(`tray-${name}`) : null);
  };
  const opened = () => tools.find((tool) => tool.getAttribute("aria-expanded") === "true");
  for (const tool of tools) {
    tool.addEventListener("click", () => {
      open(tool.getAttribute("aria-expanded") === "true" ? null : (tool.dataset.tray ?? null));
    });
  }
  box("viewer").addEventListener("keydown", (event) => {
    if (event.key !== "Escape") return;
    const tool = opened();
    open(null);
    tool?.focus();
  });
  // A tap outside of an open tray closes it and places nothing; a drag moves the object all the same.
  box("viewer").addEventListener(
    "pointerdown",
    (event) => {
      if (event.target !== box("view") || !opened()) return;
      event.preventDefault();
      open(null);
    },
    true,
  );
}

/** A button that is on or off. */
export function press(id: string, is: boolean): void {
  button(id).setAttribute("aria-pressed", String(is));
}
