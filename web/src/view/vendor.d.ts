declare module "draco3dgltf/draco_decoder_gltf_nodejs.js" {
  const createDecoder: (options: object) => unknown;
  export default createDecoder;
}
