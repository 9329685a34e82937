/** The objects to choose from, and the one that stands in the picture. */
import { BuiltIn, type BuiltInFacts, builtIns } from "./built-in.ts";
import type { Exhibit, Part } from "./exhibit.ts";
import { MATERIALS, type MaterialName } from "./material.ts";
import type { Stage } from "./stage.ts";

interface Choice {
  readonly name: string;
  readonly label: string;
}

const OWN = "own";

export class Showroom {
  /** Empty until `open` or `choose` has put something there. */
  chosen = "";
  private facts: readonly BuiltInFacts[] = [];
  private readonly made = new Map<string, Exhibit>();
  private own: File | null = null;
  private wanted: MaterialName = "diffuse";

  constructor(private readonly stage: Stage) {}

  get choices(): readonly Choice[] {
    const choices = this.facts.map(({ name, title }) => ({ name, label: title }));
    return this.own ? [...choices, { name: OWN, label: this.own.name }] : choices;
  }

  get materials(): readonly MaterialName[] {
    return this.made.get(this.chosen)?.materials ?? [];
  }

  get material(): MaterialName | null {
    return this.made.get(this.chosen)?.material ?? null;
  }

  /** The object in its material and light of now; none before there is one. */
  get parts(): readonly Part[] {
    return this.made.get(this.chosen)?.parts() ?? [];
  }

  /** What is chosen has a file of its own on this page's host. */
  get isBuiltIn(): boolean {
    return this.facts.some(({ name }) => name === this.chosen);
  }

  /** Without a name the first one. @throws Failure `object-missing`. */
  async choose(name?: string): Promise<void> {
    if (!this.facts.length) this.facts = await builtIns();
    const facts = this.facts.find((one) => one.name === name) ?? this.facts[0];
    if (name === OWN || !facts) return this.putAgain();
    const exhibit = this.made.get(facts.name) ?? (await BuiltIn.load(facts));
    this.made.set(facts.name, exhibit);
    this.put(facts.name, exhibit);
  }

  /** @throws Failure `glb-too-large` or `glb-broken`; what stood there stays. */
  async open(file: File): Promise<void> {
    const { OwnObject } = await import("./glb.ts"); // with three.js's reader: not before it is needed
    const exhibit = await OwnObject.open(file);
    this.made.get(OWN)?.dispose();
    this.made.set(OWN, exhibit);
    this.own = file;
    this.wanted = "file";
    this.put(OWN, exhibit);
  }

  setMaterial(name: string): void {
    const known = MATERIALS.find((material) => material === name);
    if (!known) return;
    this.wanted = known;
    this.made.get(this.chosen)?.setMaterial(known);
    this.stage.relight();
  }

  private putAgain(): void {
    const own = this.made.get(OWN);
    if (own) this.put(OWN, own);
  }

  private put(name: string, exhibit: Exhibit): void {
    this.chosen = name;
    const { materials } = exhibit;
    exhibit.setMaterial(materials.includes(this.wanted) ? this.wanted : materials[0]!);
    this.stage.exhibitNow(exhibit);
  }
}
