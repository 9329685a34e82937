/** The user's own object: a .glb file, read here and nowhere else. */

import { type Light as Estimated, irradiance, type Matrix3x3, product } from "deeplight/core";
import {
  Box3,
  type BufferGeometry,
  Group,
  Light,
  LoadingManager,
  type Material,
  Matrix3,
  type Matrix4,
  Mesh,
  type MeshBasicMaterial,
  MeshStandardMaterial,
  type Object3D,
  type Texture,
  Vector3,
} from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { Failure } from "../failure.ts";
import { BallLight } from "./ball-light.ts";
import type { Exhibit, Part } from "./exhibit.ts";
import { FloorShadow } from "./floor-shadow.ts";
import { MATERIALS, type MaterialName, standardMaterial } from "./material.ts";
import { unpackersOf } from "./packed.ts";

const MOST_BYTES = 100e6;
const MOST_TRIANGLES = 2e6;

export class OwnObject implements Exhibit {
  readonly object = new Group();
  readonly materials = MATERIALS;
  material: MaterialName = "file";
  private readonly light = new BallLight();
  private readonly shadow: FloorShadow;
  /** Of the light of now, in the object's own frame. */
  private harmonics: () => Float32Array = () => new Float32Array(27);
  /** Each part with the material that it came with. */
  private readonly materialOf = new Map<Mesh, Material | Material[]>();

  private constructor(model: Object3D, triangles: number) {
    standing(model);
    for (const mesh of meshesOf(model)) {
      this.materialOf.set(mesh, mesh.material);
      for (const material of [mesh.material].flat()) {
        if (material instanceof MeshStandardMaterial) this.light.lights(material);
      }
    }
    this.shadow = new FloorShadow(model, triangles);
    this.object.add(model, this.shadow.mesh);
  }

  /** @throws Failure `glb-too-large`, `glb-packed` or `glb-broken`. */
  static async open(file: Blob): Promise<OwnObject> {
    if (file.size > MOST_BYTES) throw new Failure("glb-too-large");
    const model = await parsed(await file.arrayBuffer());
    const triangles = meshesOf(model).reduce((sum, { geometry }) => {
      const corners = geometry.index?.count ?? geometry.attributes.position?.count ?? 0;
      return sum + corners / 3;
    }, 0);
    if (triangles < 1) throw new Failure("glb-broken", "no triangles");
    if (triangles > MOST_TRIANGLES) throw new Failure("glb-too-large");
    return new OwnObject(model, triangles);
  }

  setMaterial(name: MaterialName): void {
    this.material = name;
    const one = name === "file" ? null : this.made(name);
    for (const [mesh, own] of this.materialOf) mesh.material = one ?? own;
  }

  setLight(light: Estimated, worldFromCamera: Matrix3x3, objectFromWorld: Matrix3x3): void {
    const objectFromCamera = product(objectFromWorld, worldFromCamera);
    this.light.set(light, worldFromCamera);
    this.shadow.setLight(light, objectFromCamera);
    this.harmonics = () => light.lighting.turned(objectFromCamera).harmonics(2);
  }

  parts(): readonly Part[] {
    const harmonics = this.harmonics();
    const { material: name } = this;
    const one = name === "file" ? null : standardMaterial(name);
    this.object.updateMatrixWorld(true);
    const objectFromWorld = this.object.matrixWorld.clone().invert();
    return [...this.materialOf].map(([mesh, own]) => {
      const { geometry } = mesh;
      if (!geometry.attributes.normal) geometry.computeVertexNormals();
      const matrix = objectFromWorld.clone().multiply(mesh.matrixWorld);
      const material = one ?? standardOf([own].flat()[0]!);
      return { geometry, matrix, material, sent: sentByAll(geometry, matrix, harmonics) };
    });
  }

  private made(name: Exclude<MaterialName, "file">): Material {
    return name === "mirror" ? this.light.mirror() : this.light.lights(standardMaterial(name));
  }

  dispose(): void {
    this.shadow.dispose();
    this.light.dispose();
    for (const [mesh, own] of this.materialOf) {
      mesh.geometry.dispose();
      for (const material of [own].flat()) forget(material);
    }
  }
}

async function parsed(file: ArrayBuffer): Promise<Object3D> {
  const manager = new LoadingManager();
  manager.setURLModifier((url) => {
    // Nothing is ever fetched from elsewhere: what the file does not hold is missing.
    if (/^(blob|data):/.test(url)) return url;
    throw new Failure("glb-broken", `the file refers to ${url}`);
  });
  const loader = new GLTFLoader(manager);
  const unpackers = await unpackersOf(loader, file);
  try {
    const { scene } = await loader.parseAsync(file, "");
    if (unpackers.problem) throw new Failure("glb-packed", String(unpackers.problem));
    withoutLamps(scene);
    return scene;
  } catch (error) {
    if (error instanceof Failure) throw error;
    throw new Failure("glb-broken", String(error));
  } finally {
    unpackers.dispose();
  }
}

/** Exporters take lamps along; here the light is the place's. */
function withoutLamps(model: Object3D): void {
  const lamps: Object3D[] = [];
  model.traverse((part) => {
    if (part instanceof Light) lamps.push(part);
  });
  for (const lamp of lamps) lamp.removeFromParent();
}

/** Puts the model on y = 0 around the origin, its longest side 1. */
function standing(model: Object3D): void {
  model.updateMatrixWorld(true);
  const bounds = new Box3().setFromObject(model, true);
  const size = bounds.getSize(new Vector3());
  const longest = Math.max(size.x, size.y, size.z);
  if (!(longest > 0 && Number.isFinite(longest))) throw new Failure("glb-broken", "no extent");
  const middle = bounds.getCenter(new Vector3());
  model.scale.multiplyScalar(1 / longest);
  model.position.sub(new Vector3(middle.x, bounds.min.y, middle.z)).multiplyScalar(1 / longest);
}

function meshesOf(model: Object3D): Mesh[] {
  const found: Mesh[] = [];
  model.traverse((part) => {
    if (part instanceof Mesh) found.push(part);
  });
  return found;
}

/** RGB that leaves each vertex per unit of albedo, as three.js lights by harmonics: nothing is in its own shadow. */
function sentByAll({ attributes }: BufferGeometry, matrix: Matrix4, harmonics: Float32Array) {
  const normals = attributes.normal!;
  const turn = new Matrix3().getNormalMatrix(matrix);
  const sent = new Float32Array(3 * normals.count);
  const normal = new Vector3();
  for (let vertex = 0; vertex < normals.count; vertex++) {
    normal.fromBufferAttribute(normals, vertex).applyMatrix3(turn).normalize();
    const rgb = irradiance(harmonics, normal.toArray());
    sent.set(
      rgb.map((value) => Math.max(value / Math.PI, 0)),
      3 * vertex,
    );
  }
  return sent;
}

/** A material for programs that know no others; one that is not lit emits its colour. */
function standardOf(own: Material): MeshStandardMaterial {
  if (own instanceof MeshStandardMaterial) return own;
  const { color, map } = own as MeshBasicMaterial;
  return new MeshStandardMaterial({ color: 0, emissive: color, emissiveMap: map, roughness: 1 });
}

function forget(material: Material): void {
  for (const value of Object.values(material)) {
    if ((value as Texture | null)?.isTexture) (value as Texture).dispose();
  }
  material.dispose();
}
