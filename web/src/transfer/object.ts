/** An object and its shadow on the ground, shaded by transfer; both are lit by `setLight`. */

import { GAMMA, TRANSFER } from "deeplight/core";
import {
  AddEquation,
  BufferAttribute,
  BufferGeometry,
  CustomBlending,
  DataTexture,
  DoubleSide,
  DstColorFactor,
  FloatType,
  GLSL3,
  Mesh,
  OneFactor,
  RGBAFormat,
  ShaderMaterial,
  ZeroFactor,
} from "three";
import { fitting, meet, metLength, shadowRatios } from "./evaluate.ts";
import {
  type GlossyTransfer,
  type GroundTransfer,
  type Transfer,
  TransferError,
} from "./format.ts";
import {
  diffuseVertex,
  glossyVertex,
  PIXEL_FRAGMENT,
  SHADOW_FRAGMENT,
  SHADOW_VERTEX,
  TEXTURE_WIDTH,
} from "./shader.ts";

export type TransferFinish = "diffuse" | "glossy";

/** Draws pixels of the photo's encoding, without tone mapping and colour space of three.js. */
export interface TransferObject extends Mesh<BufferGeometry, ShaderMaterial> {
  /** Radiance coefficients x RGB in the object's own frame; other orders are cut or filled up with 0. */
  setLight(harmonics: Float32Array): void;
  /** Linear factor on radiance before the clip; 1 is the photo's own exposure. */
  setExposure(factor: number): void;
  /** Linear RGB instead of the file's; an object with colours of its own keeps them. */
  setReflectivity(red: number, green: number, blue: number): void;
  dispose(): void;
}

export interface GroundShadow extends Mesh<BufferGeometry, ShaderMaterial> {
  setLight(harmonics: Float32Array): void;
  /** 0 is no shadow, 1 the full one. */
  setStrength(share: number): void;
  dispose(): void;
}

/** @throws TransferError for a glossy finish that the file does not hold. */
export function makeTransferObject(transfer: Transfer, finish: TransferFinish): TransferObject {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(transfer.positions, 3));
  geometry.setAttribute("normal", new BufferAttribute(transfer.normals, 3));
  geometry.setIndex(new BufferAttribute(transfer.triangles, 1));
  const shading =
    finish === "diffuse" ? diffuseShading(transfer, geometry) : glossyShading(transfer);
  const { material } = shading;
  return Object.assign(new Mesh(geometry, material), {
    setLight: shading.setLight,
    setExposure(factor: number) {
      material.uniforms.exposure!.value = factor;
    },
    setReflectivity(red: number, green: number, blue: number) {
      material.uniforms.tint!.value = [red, green, blue];
    },
    dispose() {
      geometry.dispose();
      material.dispose();
      for (const texture of shading.textures) texture.dispose();
    },
  });
}

/** The plane around the object, which darkens what is drawn below it. @throws TransferError without ground. */
export function makeGroundShadow(transfer: Transfer): GroundShadow {
  const { ground, order } = transfer;
  if (!ground) throw new TransferError("This object's file holds no ground to throw a shadow on.");
  const geometry = groundGeometry(ground);
  const ratio = geometry.getAttribute("ratio") as BufferAttribute;
  const material = new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader: SHADOW_VERTEX,
    fragmentShader: SHADOW_FRAGMENT,
    uniforms: { strength: { value: 1 } },
    transparent: true,
    depthWrite: false,
    toneMapped: false,
    blending: CustomBlending,
    blendEquation: AddEquation,
    blendSrc: DstColorFactor,
    blendDst: ZeroFactor,
    blendSrcAlpha: ZeroFactor,
    blendDstAlpha: OneFactor,
  });
  return Object.assign(new Mesh(geometry, material), {
    setLight(harmonics: Float32Array) {
      ratio.copyArray(shadowRatios(ground, order, harmonics));
      ratio.needsUpdate = true;
    },
    setStrength(share: number) {
      material.uniforms.strength!.value = share;
    },
    dispose() {
      geometry.dispose();
      material.dispose();
    },
  });
}

interface Shading {
  readonly material: ShaderMaterial;
  readonly textures: readonly DataTexture[];
  setLight(harmonics: Float32Array): void;
}

function diffuseShading(transfer: Transfer, geometry: BufferGeometry): Shading {
  const coefficients = (transfer.order + 1) ** 2;
  const table = vertexTexture(transfer.diffuse, coefficients);
  const light = new Float32Array(12 * Math.ceil(coefficients / 4));
  const material = pixelMaterial(diffuseVertex(coefficients), {
    transfer: { value: table },
    light: { value: light },
    tint: { value: [...transfer.reflectivity] },
  });
  if (transfer.colours) {
    const linear = Float32Array.from(transfer.colours, (value) => (value / 255) ** GAMMA);
    geometry.setAttribute("tint", new BufferAttribute(linear, 3));
    material.defines = { COLOURED: "" };
  }
  const setLight = (harmonics: Float32Array) => light.set(fitting(harmonics, coefficients));
  return { material, textures: [table], setLight };
}

function glossyShading(transfer: Transfer): Shading {
  const { glossy, order } = transfer;
  if (!glossy) throw new TransferError("This object's file holds no glossy finish.");
  const { components, reflectivity } = glossy;
  const table = vertexTexture(withClusters(glossy), components + 1);
  const met = numberTexture(metLength(transfer) / 4);
  const material = pixelMaterial(glossyVertex(order, components), {
    transfer: { value: table },
    met: { value: met },
    tint: { value: [reflectivity, reflectivity, reflectivity] },
  });
  const setLight = (harmonics: Float32Array) => {
    meet(
      glossy,
      fitting(harmonics, (order + 1) ** 2),
      met.image.data.subarray(0, metLength(transfer)),
    );
    met.needsUpdate = true;
  };
  return { material, textures: [table, met], setLight };
}

/** Each vertex's cluster, then its weights. */
function withClusters({ cluster, weights, components }: GlossyTransfer): Float32Array {
  const joined = new Float32Array(cluster.length * (components + 1));
  cluster.forEach((number, vertex) => {
    const at = vertex * (components + 1);
    joined[at] = number;
    joined.set(weights.subarray(vertex * components, (vertex + 1) * components), at + 1);
  });
  return joined;
}

function pixelMaterial(
  vertexShader: string,
  uniforms: Record<string, { value: unknown }>,
): ShaderMaterial {
  return new ShaderMaterial({
    glslVersion: GLSL3,
    vertexShader,
    fragmentShader: PIXEL_FRAGMENT,
    uniforms: { ...uniforms, exposure: { value: 1 } },
    side: DoubleSide,
    toneMapped: false,
  });
}

type NumberTexture = DataTexture & { image: { data: Float32Array } };

/** `columns` numbers of each vertex, filled up to whole texels. */
function vertexTexture(table: Float32Array, columns: number): NumberTexture {
  const texels = Math.ceil(columns / 4);
  const rows = table.length / columns;
  const texture = numberTexture(rows * texels);
  for (let row = 0; row < rows; row++) {
    texture.image.data.set(table.subarray(row * columns, (row + 1) * columns), row * texels * 4);
  }
  texture.needsUpdate = true;
  return texture;
}

function numberTexture(texels: number): NumberTexture {
  const height = Math.max(1, Math.ceil(texels / TEXTURE_WIDTH));
  const data = new Float32Array(4 * TEXTURE_WIDTH * height);
  return new DataTexture(data, TEXTURE_WIDTH, height, RGBAFormat, FloatType) as NumberTexture;
}

/** The file's points, joined to squares that face up; `reach` is 0 in the middle and 1 along the edge. */
function groundGeometry({ size, half }: GroundTransfer): BufferGeometry {
  const middle = TRANSFER.ground_middle_step;
  const along = Array.from({ length: size }, (_, i) => (2 * i) / (size - 1) - 1);
  const place = along.map((t) => half * (middle * t + (1 - middle) * t ** 3));
  const positions = along.flatMap((_, row) => place.flatMap((x) => [x, 0, place[row]!]));
  const reach = along.flatMap((z) => along.map((x) => Math.max(Math.abs(x), Math.abs(z))));
  const corners: number[] = [];
  for (let row = 0; row + 1 < size; row++) {
    for (let column = 0; column + 1 < size; column++) {
      const a = row * size + column;
      corners.push(a, a + size, a + 1, a + 1, a + size, a + size + 1);
    }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  geometry.setAttribute("reach", new BufferAttribute(new Float32Array(reach), 1));
  geometry.setAttribute("ratio", new BufferAttribute(new Float32Array(3 * size ** 2).fill(1), 3));
  geometry.setIndex(corners);
  return geometry;
}
