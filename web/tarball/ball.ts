/** A .glb file of a metal ball of radius 1, little rough. */
const [ROWS, COLUMNS] = [32, 64];

export function ballGlb(): Buffer {
  const positions: number[] = [];
  const corners: number[] = [];
  for (let row = 0; row <= ROWS; row++) {
    for (let column = 0; column <= COLUMNS; column++) {
      const [theta, phi] = [(row / ROWS) * Math.PI, (column / COLUMNS) * 2 * Math.PI];
      const across = Math.sin(theta);
      positions.push(across * Math.cos(phi), Math.cos(theta), -across * Math.sin(phi));
      if (row === ROWS || column === COLUMNS) continue;
      const at = row * (COLUMNS + 1) + column;
      const below = at + COLUMNS + 1;
      corners.push(at, below, at + 1, at + 1, below, below + 1);
    }
  }
  const points = Buffer.from(Float32Array.from(positions).buffer);
  const triangles = Buffer.from(Uint16Array.from(corners).buffer);
  const vectors = { bufferView: 0, componentType: 5126, count: positions.length / 3, type: "VEC3" };
  const text = JSON.stringify({
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0 }],
    materials: [{ pbrMetallicRoughness: { metallicFactor: 1, roughnessFactor: 0.2 } }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1 }, indices: 2, material: 0 }] }],
    accessors: [
      { ...vectors, min: [-1, -1, -1], max: [1, 1, 1] },
      vectors,
      { bufferView: 1, componentType: 5123, count: corners.length, type: "SCALAR" },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: points.length },
      { buffer: 0, byteOffset: points.length, byteLength: triangles.length },
    ],
    buffers: [{ byteLength: points.length + triangles.length }],
  });
  const json = Buffer.from(text.padEnd((text.length + 3) & ~3));
  const words = (...values: number[]) => Buffer.from(Uint32Array.from(values).buffer);
  const binary = points.length + triangles.length;
  const heads = [words(0x46546c67, 2, 28 + json.length + binary), words(json.length, 0x4e4f534a)];
  return Buffer.concat([...heads, json, words(binary, 0x004e4942), points, triangles]);
}
