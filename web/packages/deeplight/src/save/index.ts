export { hdrFile, panoramaFile } from "./hdr-file.ts";
export { type About, jsonFile } from "./json-file.ts";
