/** The built-in objects: diffuse and silver by precomputed transfer, mirror and gloss by the light's ball. */

import { IDENTITY, LIGHTING_SIZE, Light, Lighting, type Matrix3x3, product } from "deeplight/core";
import { Group, Matrix4, Mesh } from "three";
import { Failure } from "../failure.ts";
import {
  makeTransferObject,
  parseTransfer,
  sentByAll,
  type Transfer,
  TransferError,
  type TransferObject,
} from "../transfer/index.ts";
import { BallLight } from "./ball-light.ts";
import type { Exhibit, Part } from "./exhibit.ts";
import { FloorShadow } from "./floor-shadow.ts";
import { type MaterialName, standardMaterial } from "./material.ts";

/** One line of objects/index.json. */
export interface BuiltInFacts {
  readonly name: string;
  readonly title: string;
  readonly file: string;
}

type Finish = "diffuse" | "silver" | "mirror" | "glossy";

export class BuiltIn implements Exhibit {
  readonly object = new Group();
  readonly materials: readonly Finish[] = ["diffuse", "silver", "mirror", "glossy"];
  material: Finish = "diffuse";
  private readonly shadow: FloorShadow;
  private readonly made = new Map<Finish, Mesh>();
  private readonly ballLight = new BallLight();
  private harmonics: Float32Array | null = null;

  private constructor(private readonly transfer: Transfer) {
    this.setMaterial("diffuse");
    this.shadow = new FloorShadow(this.mesh(), transfer.triangles.length / 3);
    this.object.add(this.shadow.mesh);
  }

  /** @throws Failure `object-missing`. */
  static async load({ file }: BuiltInFacts): Promise<BuiltIn> {
    const response = await fetched(file);
    try {
      const made = new BuiltIn(parseTransfer(await response.arrayBuffer()));
      // The first light makes tables for all others: better while nobody waits for it.
      const white = new Lighting(new Float32Array(3 * LIGHTING_SIZE ** 2));
      made.setLight(new Light(white, null), IDENTITY, IDENTITY);
      return made;
    } catch (error) {
      throw error instanceof TransferError ? new Failure("object-missing", error.message) : error;
    }
  }

  setMaterial(name: MaterialName): void {
    this.object.remove(this.mesh());
    this.material = name === "file" ? "diffuse" : name;
    this.object.add(this.mesh());
    this.light();
  }

  setLight(light: Light, worldFromCamera: Matrix3x3, objectFromWorld: Matrix3x3): void {
    const objectFromCamera = product(objectFromWorld, worldFromCamera);
    const turned = light.lighting.turned(objectFromCamera);
    this.harmonics = turned.harmonics(this.transfer.order);
    this.ballLight.set(light, worldFromCamera);
    this.shadow.setLight(light, objectFromCamera);
    this.light();
  }

  parts(): readonly Part[] {
    const { transfer, material } = this;
    const light = this.harmonics ?? new Float32Array();
    return [
      {
        geometry: this.made.get("diffuse")!.geometry,
        matrix: new Matrix4(),
        material: standardMaterial(material),
        sent: sentByAll(transfer, light),
      },
    ];
  }

  dispose(): void {
    this.shadow.dispose();
    this.ballLight.dispose();
    for (const mesh of this.made.values()) mesh.geometry.dispose();
  }

  private light(): void {
    const mesh = this.mesh();
    if (!this.harmonics) return;
    if (isTransfer(mesh)) mesh.setLight(this.harmonics);
  }

  /** What is drawn in the material of now. */
  private mesh(): Mesh {
    const made = this.made.get(this.material) ?? this.make();
    this.made.set(this.material, made);
    return made;
  }

  private make(): Mesh {
    if (this.material === "diffuse") return makeTransferObject(this.transfer, "diffuse");
    if (this.material === "silver" && this.transfer.glossy) {
      return makeTransferObject(this.transfer, "glossy");
    }
    // The transfer object was made first, in the constructor; its shape serves them all.
    const { geometry } = this.made.get("diffuse")!;
    const { ballLight, material } = this;
    const isMirror = material === "mirror";
    return new Mesh(
      geometry,
      isMirror ? ballLight.mirror() : ballLight.lights(standardMaterial(material)),
    );
  }
}

/** The objects there are. @throws Failure `object-missing`. */
export async function builtIns(): Promise<readonly BuiltInFacts[]> {
  return (await fetched("index.json")).json();
}

async function fetched(file: string): Promise<Response> {
  const url = new URL(`objects/${file}`, document.baseURI);
  const response = await fetch(url).catch((error: unknown) => {
    throw new Failure("object-missing", String(error));
  });
  if (!response.ok) throw new Failure("object-missing", `${url}: ${response.status}`);
  return response;
}

function isTransfer(mesh: Mesh): mesh is TransferObject {
  return "setLight" in mesh;
}
