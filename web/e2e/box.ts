/** A lamp as bright as the sun, as an exporter takes it along with what it lit. */
export const LIT = {
  extensionsUsed: ["KHR_lights_punctual"],
  extensions: { KHR_lights_punctual: { lights: [{ type: "directional", intensity: 100 }] } },
  nodes: [{ mesh: 0 }, { extensions: { KHR_lights_punctual: { light: 0 } } }],
  scenes: [{ nodes: [0, 1] }],
};

/** A .glb file with one red box in it, as an exporter would write it; `more` of it, or other. */
export function boxGlb(more: object = {}): Buffer {
  const [positions, normals, corners] = faces();
  const blobs = [positions, normals, corners].map((values) => Buffer.from(values.buffer));
  const views = blobs.map(({ length }, i) => ({
    buffer: 0,
    byteOffset: blobs.slice(0, i).reduce((sum, blob) => sum + blob.length, 0),
    byteLength: length,
  }));
  const vectors = { componentType: 5126, count: 24, type: "VEC3" };
  const json = {
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    materials: [
      { pbrMetallicRoughness: { baseColorFactor: [0.8, 0.02, 0.02, 1], metallicFactor: 0 } },
    ],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1 }, indices: 2, material: 0 }] }],
    accessors: [
      { bufferView: 0, ...vectors, min: [-2, -2, -2], max: [2, 2, 2] },
      { bufferView: 1, ...vectors },
      { bufferView: 2, componentType: 5123, count: 36, type: "SCALAR" },
    ],
    bufferViews: views,
    buffers: [{ byteLength: blobs.reduce((sum, blob) => sum + blob.length, 0) }],
    ...more,
  };
  const text = Buffer.from(JSON.stringify(json));
  return glb(Buffer.concat([text, Buffer.alloc(-text.length & 3, " ")]), Buffer.concat(blobs));
}

function glb(json: Buffer, binary: Buffer): Buffer {
  const words = (...values: number[]): Buffer => Buffer.from(Uint32Array.from(values).buffer);
  const length = 12 + 8 + json.length + 8 + binary.length;
  const heads = [words(0x46546c67, 2, length), words(json.length, 0x4e4f534a)];
  return Buffer.concat([...heads, json, words(binary.length, 0x004e4942), binary]);
}

/** Six faces of four corners each, 4 units along a side. */
function faces(): [Float32Array, Float32Array, Uint16Array] {
  const [positions, normals, corners]: [number[], number[], number[]] = [[], [], []];
  for (let face = 0; face < 6; face++) {
    const [axis, side] = [face % 3, face < 3 ? 1 : -1];
    for (const [a, b] of [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, 1],
    ] as const) {
      const point = [0, 0, 0];
      point[axis] = side * 2;
      point[(axis + 1) % 3] = a * 2 * side;
      point[(axis + 2) % 3] = b * 2;
      positions.push(...point);
      normals.push(...[0, 1, 2].map((i) => (i === axis ? side : 0)));
    }
    corners.push(...[0, 1, 2, 0, 2, 3].map((corner) => 4 * face + corner));
  }
  return [Float32Array.from(positions), Float32Array.from(normals), Uint16Array.from(corners)];
}
