/** The page's elements by id; index.html is the only place that makes them. */
export function element<T extends HTMLElement>(id: string, kind: new () => T): T {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`index.html has no ${kind.name} #${id}`);
  return found;
}

export const button = (id: string): HTMLButtonElement => element(id, HTMLButtonElement);
export const canvas = (id: string): HTMLCanvasElement => element(id, HTMLCanvasElement);
export const input = (id: string): HTMLInputElement => element(id, HTMLInputElement);
export const box = (id: string): HTMLElement => element(id, HTMLElement);

/** Says something to who does not see the page. */
export function announce(text: string): void {
  box("status").textContent = text;
}
