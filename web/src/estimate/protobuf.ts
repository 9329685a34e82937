/** The wire format of protocol buffers, as far as ONNX files need it. */
import { EstimateError } from "./errors.ts";

export interface Field {
  readonly number: number;
  /** Of a number; 0 where it is something else. */
  readonly value: number;
  /** Of a text, bytes or a message; empty where it is a number. */
  readonly content: Uint8Array;
  /** With its head, to be copied as it is. */
  readonly whole: Uint8Array;
}

const [VARINT, EIGHT_BYTES, LENGTH, FOUR_BYTES] = [0, 1, 2, 5];
const NOTHING = new Uint8Array();

/** @throws EstimateError `model-damaged` where the message ends too early or is none. */
export function* fieldsOf(message: Uint8Array): Generator<Field> {
  let at = 0;
  const varint = (): number => {
    let [value, scale] = [0, 1];
    for (let byte = 128; byte >= 128; at++, scale *= 128) {
      byte = message[at] ?? cut();
      value += (byte & 127) * scale;
    }
    return value;
  };
  while (at < message.length) {
    const start = at;
    const tag = varint();
    const kind = tag % 8;
    let [value, length] = [0, 0];
    if (kind === VARINT) value = varint();
    else if (kind === EIGHT_BYTES) at += 8;
    else if (kind === FOUR_BYTES) at += 4;
    else if (kind === LENGTH) {
      length = varint();
      at += length;
    } else cut();
    if (at > message.length) cut();
    const content = kind === LENGTH ? message.subarray(at - length, at) : NOTHING;
    yield { number: Math.floor(tag / 8), value, content, whole: message.subarray(start, at) };
  }
}

/** A field that is a message or bytes. */
export function packed(number: number, content: Uint8Array): Uint8Array {
  return joined([head(8 * number + LENGTH), head(content.length), content]);
}

export function packedText(number: number, text: string): Uint8Array {
  return packed(number, new TextEncoder().encode(text));
}

export function packedNumber(number: number, value: number): Uint8Array {
  return joined([head(8 * number + VARINT), head(value)]);
}

export function packedFloat(number: number, value: number): Uint8Array {
  const bytes = new Uint8Array(4);
  new DataView(bytes.buffer).setFloat32(0, value, true);
  return joined([head(8 * number + FOUR_BYTES), bytes]);
}

export function joined(parts: readonly Uint8Array[]): Uint8Array {
  const result = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    result.set(part, at);
    at += part.length;
  }
  return result;
}

export function text(bytes: Uint8Array): string {
  return new TextDecoder().decode(bytes);
}

function head(value: number): Uint8Array {
  const bytes: number[] = [];
  let rest = value;
  for (; rest >= 128; rest = Math.floor(rest / 128)) bytes.push((rest % 128) + 128);
  return Uint8Array.from([...bytes, rest]);
}

function cut(): never {
  throw new EstimateError("model-damaged", "expected a complete ONNX file, got something else");
}
