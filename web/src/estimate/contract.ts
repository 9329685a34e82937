/** The contract inside a model file, read from its bytes: contract.py. */
import { CONTRACT, CONTRACT_KEY, SERVED } from "../contract/generated.ts";
import { EstimateError } from "./errors.ts";

type Widened<T> = T extends number
  ? number
  : T extends string
    ? string
    : { [K in keyof T]: Widened<T[K]> };

export type Contract = Widened<typeof CONTRACT>;

const METADATA = 14; // field `metadata_props` of an ONNX ModelProto; its entries have 1 key, 2 value

/** @throws EstimateError where the file is no model of ours or one this page cannot serve. */
export function contractOf(model: Uint8Array): Contract {
  for (const entry of fields(model, METADATA)) {
    const [key] = fields(entry, 1);
    const [value] = fields(entry, 2);
    if (key && value && text(key) === CONTRACT_KEY) return checked(text(value));
  }
  throw new EstimateError("model-damaged", `expected '${CONTRACT_KEY}' in the model, got none`);
}

function checked(json: string): Contract {
  const entries: Record<string, unknown> = parsed(json);
  const refuse = (name: string, want: unknown) => {
    const got = JSON.stringify(entries[name]);
    return new EstimateError(
      "model-version",
      `expected ${name} ${JSON.stringify(want)}, got ${got}`,
    );
  };
  if (entries.version !== CONTRACT.version) throw refuse("version", CONTRACT.version);
  for (const [name, value] of Object.entries(SERVED)) {
    if (entries[name] !== value) throw refuse(name, value);
  }
  for (const [name, value] of Object.entries(CONTRACT)) {
    if (typeof entries[name] !== typeof value) throw refuse(name, value);
  }
  const contract = entries as Contract;
  const sane =
    contract.width > 0 &&
    contract.height > 0 &&
    contract.vertical_fov_deg > 0 &&
    contract.vertical_fov_deg < 180 &&
    contract.frame_aspect > 0 &&
    contract.input_high > contract.input_low &&
    contract.background_top < contract.background_fraction;
  if (!sane) throw new EstimateError("model-damaged", "expected possible sizes in the contract");
  return contract;
}

function parsed(json: string): Record<string, unknown> {
  try {
    return JSON.parse(json);
  } catch {
    throw new EstimateError("model-damaged", "expected a contract in JSON, got something else");
  }
}

/** The contents of each field of this number in a protocol buffer. */
function* fields(message: Uint8Array, wanted: number): Generator<Uint8Array> {
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
    const tag = varint();
    const [field, kind] = [Math.floor(tag / 8), tag % 8];
    if (kind === 0) varint();
    else if (kind === 1) at += 8;
    else if (kind === 5) at += 4;
    else if (kind === 2) {
      const length = varint();
      if (at + length > message.length) cut();
      if (field === wanted) yield message.subarray(at, at + length);
      at += length;
    } else cut();
  }
}

function cut(): never {
  throw new EstimateError("model-damaged", "expected a complete ONNX file, got something else");
}

function text(bytes: Uint8Array): string {
  return new TextDecoder().decode(bytes);
}
