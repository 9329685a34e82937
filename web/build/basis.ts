/**
 * Basis Universal's transcoder of KTX2 textures makes functions of text while it starts, which the page's content
 * policy forbids. The two places where it does are put in other words here: the same functions, written out.
 */
import type { Plugin } from "vite";

const PLACES = [
  {
    // Calls a function of the transcoder: its arguments, and the object, as the transcoder has them.
    text: "var invokerFn=newFunc(Function,args)(...closureArgs);",
    same: `var invokerFn = function (...given) {
      if (given.length !== argCount - 2) {
        throwBindingError("function " + humanName + " called with " + given.length + " arguments");
      }
      const destructors = needsDestructorStack ? [] : null;
      const first = isClassMethodFunc ? 1 : 2;
      const wired = argTypes.slice(first).map((type, i) => {
        return type.toWireType(destructors, i < 2 - first ? this : given[i + first - 2]);
      });
      const got = cppInvokerFunc(cppTargetFunc, ...wired);
      if (destructors) runDestructors(destructors);
      else argTypes.slice(first).forEach((type, i) => type.destructorFunction?.(wired[i]));
      return returns ? argTypes[0].fromWireType(got) : undefined;
    };`,
  },
  {
    // Calls a function of ours for the transcoder, with arguments that lie in its memory.
    text: "var invokerFunction=newFunc(Function,params)(...args);",
    same: `var invokerFunction = (obj, func, destructorsRef, place) => {
      let at = place;
      const given = types.slice(0, argCount).map((type) => {
        const value = type.readValueFromPointer(at);
        at += type.argPackAdvance;
        return value;
      });
      const got = kind === 1 ? new func(...given) : func.call(obj, ...given);
      return retType.isVoid ? undefined : emval_returnValue(retType, destructorsRef, got);
    };`,
  },
] as const;

/** @throws Error where the transcoder is another one than these words were made for. */
export function withoutEval(code: string): string {
  const written = PLACES.reduce((text, place) => {
    if (text.split(place.text).length !== 2) {
      throw new Error(`expected one "${place.text}" in the transcoder: another version?`);
    }
    return text.replace(place.text, () => place.same);
  }, code);
  const [transcoder] = written.split("if (typeof exports ==="); // what hands it to older module systems
  return `${transcoder}\nexport default BASIS;\n`;
}

export function basisWithoutEval(): Plugin {
  return {
    name: "deeplight:basis-without-eval",
    enforce: "pre",
    transform: {
      filter: { id: /basis_transcoder\.js$/ },
      handler: (code) => ({ code: withoutEval(code), map: null }),
    },
  };
}
