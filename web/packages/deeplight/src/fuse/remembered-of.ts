import type { View } from "./view.ts";

/** What is made of a view along certain directions, made once as long as both are the same objects. */
export function rememberedOf<T>(
  make: (view: View, directions: Float32Array) => T,
): (view: View, directions: Float32Array) => T {
  const known = new WeakMap<View, { readonly directions: Float32Array; readonly made: T }>();
  return (view, directions) => {
    const before = known.get(view);
    if (before?.directions === directions) return before.made;
    const made = make(view, directions);
    known.set(view, { directions, made });
    return made;
  };
}
