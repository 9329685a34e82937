/** Objects shaded by precomputed radiance transfer: read a file, make what three.js draws, light it. */
export { sentByAll } from "./evaluate.ts";
export {
  type GlossyTransfer,
  type GroundTransfer,
  parseTransfer,
  type Transfer,
  TransferError,
} from "./format.ts";
export {
  type GroundShadow,
  makeGroundShadow,
  makeTransferObject,
  type TransferFinish,
  type TransferObject,
} from "./object.ts";
