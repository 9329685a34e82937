declare module "draco3dgltf/draco_decoder_gltf_nodejs.js" {
  const createDecoder: (options: object) => unknown;
  export default createDecoder;
}
declare module "three/addons/libs/basis/basis_transcoder.js" {
  /** Only as `build/basis.ts` exports it. */
  const createBasis: (options: object) => Promise<import("./ktx2-decode.ts").Basis>;
  export default createBasis;
}
