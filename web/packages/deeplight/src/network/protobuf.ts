/** The wire format of protocol buffers, as far as ONNX files need it. */
import { EstimateError } from "../errors.ts";

export interface Field {
  readonly number: number;
  /** Of a number; 0 where it is something else. */
  readonly value: number;
  /** Of a text, bytes or a message; empty where it is a number. */
  readonly content: Uint8Array;
  /** With its head. */
  readonly whole: Uint8Array;
}

const [VARINT, EIGHT_BYTES, LENGTH, FOUR_BYTES] = [0, 1, 2, 5];
const NOTHING = new Uint8Array();

/** @throws EstimateError `model-damaged` where the message ends too early or is none. */
export function* fieldsOf(message: Uint8Array): Generator<Field> {
  let at = 0;
  const varint = (): number => {
    const start = at;
    let [value, scale] = [0, 1];
    for (let byte = 128; byte >= 128; at++, scale *= 128) {
      byte = message[at] ?? cut();
      value += (byte & 127) * scale;
    }
    return at - start < 10 ? value : negative(message.subarray(start, at));
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

export function text(bytes: Uint8Array): string {
  return new TextDecoder().decode(bytes);
}

/** Ten bytes hold 64 bits in two's complement. */
function negative(bytes: Uint8Array): number {
  const bits = bytes.reduceRight((sum, byte) => (sum << 7n) | BigInt(byte & 127), 0n);
  return Number(BigInt.asIntN(64, bits));
}

function cut(): never {
  throw new EstimateError("model-damaged", "expected a complete ONNX file, got something else");
}
