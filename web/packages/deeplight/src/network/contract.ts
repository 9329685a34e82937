/** The contract inside a model file, read from its bytes: contract.py. */
import {
  CONTRACT,
  CONTRACT_KEY,
  SERVED,
  SINCE_VERSION_2,
  SINCE_VERSION_3,
} from "../contract/generated.ts";
import { EstimateError } from "../errors.ts";
import { fieldsOf, text } from "./protobuf.ts";

type Widened<T> = T extends number
  ? number
  : T extends string
    ? string
    : { [K in keyof T]: Widened<T[K]> };

export type Contract = Widened<typeof CONTRACT>;

const METADATA = 14; // field `metadata_props` of an ONNX ModelProto; its entries have 1 key, 2 value

/** @throws EstimateError where the file is no model of ours or one this page cannot serve. */
export function contractOf(model: Uint8Array): Contract {
  for (const { number, content } of fieldsOf(model)) {
    if (number !== METADATA) continue;
    const [key, value] = [...fieldsOf(content)];
    if (key && value && text(key.content) === CONTRACT_KEY) return checked(text(value.content));
  }
  throw new EstimateError("model-damaged", `expected '${CONTRACT_KEY}' in the model, got none`);
}

function checked(json: string): Contract {
  let entries: Record<string, unknown> = parsed(json);
  if (entries.version === 1) {
    entries = { ...SINCE_VERSION_2, ...entries, version: 2 };
  }
  if (entries.version === 2) {
    entries = { ...SINCE_VERSION_3, ...entries, version: CONTRACT.version };
  }
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
