/** From a photo's pixels to log radiance, equal to Python; each comparison with a failing twin. */
import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, test } from "vitest";
import { bytes, floats, golden, largestError } from "../../../../tests/golden.ts";
import { noise } from "../../../../tests/noise.ts";
import { CONTRACT } from "../contract/generated.ts";
import { EstimateError } from "../errors.ts";
import { lampsOf } from "../light/lamp.ts";
import { type Contract, contractOf } from "../network/contract.ts";
import { Network } from "../network/network.ts";
import { CellMeans } from "./cell-means.ts";
import {
  type Framing,
  framePhoto,
  hull,
  looks,
  pitchOf,
  slidIntoPhoto,
  usedFraction,
  visibleFraction,
} from "./framing.ts";
import { seenFromPhoto } from "./look.ts";
import { guessedTilt } from "./upright.ts";

const MODEL = new URL("../../../../../src/deeplight/weights/deeplight.onnx", import.meta.url);
const model = new Uint8Array(readFileSync(MODEL));
const want = golden("photo");
const contract: Contract = CONTRACT;
const EDGES = ["top", "bottom", "left", "right"];
const edgesOf = ({ top, bottom, left, right }: Framing) => [top, bottom, left, right];

describe("the framing", () => {
  test.each(want.framings as Record<string, number>[])("is Python's: %o", (framing) => {
    const { photo_height: height, photo_width: width, given_fov_rad: fov } = framing;
    const got = framePhoto(height!, width!, fov ?? undefined, contract);
    const edges = [got.top, got.bottom, got.left, got.right, got.verticalFovRad];
    const names = ["top", "bottom", "left", "right", "vertical_fov_rad"];
    expect(
      largestError(
        edges,
        names.map((name) => framing[name]!),
      ),
    ).toBeLessThan(1e-8);
    expect(visibleFraction(got)).toBeCloseTo(framing.visible_fraction!, 9);
    expect(usedFraction(got)).toBeCloseTo(framing.used_fraction!, 9);
    expect(got.fovSource).toBe(framing.fov_source);
    const views = looks(slidIntoPhoto(got));
    expect(views.length).toBe(framing.looks);
    const where = (view: Framing) => [...edgesOf(view), view.down, view.aside, pitchOf(view)];
    for (const [view, name] of [
      [slidIntoPhoto(got), "slid"] as const,
      [views.at(-1)!, "last_look"] as const,
    ]) {
      const wanted = framing[name] as unknown as Record<string, number>;
      const whole = [...EDGES, "down", "aside", "pitch_rad"].map((key) => wanted[key]!);
      expect(largestError(where(view), whole)).toBeLessThan(1e-8);
    }
    const whole = framing.hull as unknown as Record<string, number>;
    const shown = edgesOf(hull(views));
    expect(
      largestError(
        shown,
        EDGES.map((key) => whole[key]!),
      ),
    ).toBeLessThan(1e-8);
  });

  test("slides down in some photos and stays in others, and looks again at some", () => {
    interface Shown {
      readonly slid: { readonly down: number };
      readonly last_look: { readonly aside: number };
      readonly looks: number;
    }
    const framings = want.framings as readonly Shown[];
    const kinds = framings.map(({ slid, last_look, looks }) => [
      Math.sign(slid.down),
      Math.sign(last_look.aside),
      looks,
    ]);
    for (const i of [0, 1, 2]) expect(new Set(kinds.map((kind) => kind[i])).size).toBe(2);
  });

  test("refuses an impossible field of view", () => {
    expect(() => framePhoto(100, 100, 4, contract)).toThrow(/between 0 and pi/);
  });
});

describe("the answers of two looks", () => {
  const { given, given_lamps, given_pitch_rad, views, ...wanted } = want.turned;
  const answers = given.map((log: unknown, i: number) => ({
    logRadiance: floats(log as never),
    others: new Map([
      ["lamps", { shape: given_lamps[i].shape, data: floats(given_lamps[i]) }],
      ["heads", { shape: [1, 1], data: Float32Array.of(given_pitch_rad[i]) }],
    ]),
  }));
  const own = { ...contract, lamps: 2, heads: ["pitch_rad"] } as unknown as Contract;
  const seen: Framing[] = views.map((view: Record<string, number>) => ({
    ...framePhoto(view.photo_height!, view.photo_width!, view.vertical_fov_rad, contract),
    down: view.down!,
    aside: view.aside!,
  }));
  const got = seenFromPhoto(answers, own, seen);

  test("are Python's as one in the photo's frame", () => {
    expect(largestError(got.logRadiance, floats(wanted.log_radiance))).toBeLessThan(2e-3);
    const lamps = lampsOf(got.others.get("lamps")!);
    const numbers = lamps.map((lamp) => [...lamp.direction, ...lamp.flux, lamp.angularRadiusRad]);
    expect(largestError(numbers.flat(), wanted.lamps.flat())).toBeLessThan(1e-4);
    expect(got.others.get("heads")!.data[0]).toBeCloseTo(wanted.head_pitch_rad, 5);
  });

  test("are others with the views exchanged, and one around the centre is itself", () => {
    const exchanged = seenFromPhoto(answers, own, [...seen].reverse()).logRadiance;
    expect(largestError(exchanged, floats(wanted.log_radiance))).toBeGreaterThan(0.1);
    const centred = [{ ...seen[0]!, down: 0, aside: 0 }];
    expect(seenFromPhoto([answers[0]], own, centred)).toBe(answers[0]);
  });
});

test("up is known by the network's pitch, but not of a photo on its side", () => {
  const turns = { upright_0: 0.5, upright_90: 0.5, upright_180: 0, upright_270: 0 };
  const heads = { pitch_rad: 0.3, pitch_scale: 0.1, ...turns };
  const pitched = [0, Math.cos(0.3), -Math.sin(0.3)];
  expect(largestError(guessedTilt(heads)!.up, pitched)).toBeLessThan(1e-12);
  expect(guessedTilt(heads)!.scaleRad).toBe(0.1);
  expect(guessedTilt({ ...heads, upright_0: 0.41, upright_90: 0.59 })).not.toBeNull();
  expect(guessedTilt({ ...heads, upright_0: 0.39, upright_90: 0.61 })).toBeNull();
  const either = { upright_0: 0.29, upright_90: 0.36, upright_270: 0.35 };
  expect(guessedTilt({ ...heads, ...either })).toBeNull();
  expect(guessedTilt({ ...heads, ...either, upright_90: 0.34 })).not.toBeNull();
});

describe("cell means", () => {
  test.each([0, 1, 2])("are Python's on a small photo, in strips of any height: %i", (i) => {
    const { framing, rgb, cells } = want.averages[i];
    const pixels = withAlpha(bytes(rgb));
    for (const rows of [1, 5, 1000]) {
      const got = averaged(pixels, asFraming(framing), rows);
      expect(largestError(got, floats(cells))).toBeLessThan(1e-5);
    }
    const shifted = averaged(pixels, { ...asFraming(framing), left: framing.left + 0.3 }, 1000);
    expect(largestError(shifted, floats(cells))).toBeGreaterThan(1e-3);
  });

  test("of one colour are that colour, also where the photo does not reach", () => {
    const framing = framePhoto(20, 30, 0.2, contract);
    const got = averaged(withAlpha(new Uint8Array(3 * 600).fill(51)), framing, 7);
    expect(largestError(got, new Float32Array(got.length).fill(0.2 - 0.5))).toBeLessThan(1e-6);
  });

  test("of the trained frame are its 8 x 8 boxes", () => {
    const pixels = noise(1080, 1920);
    const got = averaged(pixels, framePhoto(1920, 1080, undefined, contract), 700);
    for (const [row, column] of [
      [0, 0],
      [191, 134],
      [87, 3],
      [100, 100],
    ] as const) {
      for (let c = 0; c < 3; c++) {
        let sum = 0;
        for (let i = 0; i < 64; i++) {
          const [y, x] = [8 * row + (i >> 3), 8 * column + (i & 7)];
          sum += pixels[4 * (1080 * y + x) + c]!;
        }
        expect(got[(c * 192 + row) * 135 + column]).toBeCloseTo(sum / 64 / 255 - 0.5, 6);
      }
    }
  });

  test("do not depend on how the photo is cut into strips", () => {
    const pixels = noise(300, 501);
    const framing = framePhoto(501, 300, 0.4, contract);
    const whole = averaged(pixels, framing, 501);
    for (const rows of [1, 3, 50]) {
      expect(largestError(averaged(pixels, framing, rows), whole)).toBeLessThan(1e-6);
    }
  });

  test("of very wide cells do not overflow", () => {
    const framing = framePhoto(8, 8192, 0.002, {
      ...contract,
      width: 3,
      height: 2,
      frame_aspect: 1024,
    });
    const got = averaged(new Uint8ClampedArray(4 * 8 * 8192).fill(255), framing, 1);
    expect(largestError(got, new Float32Array(got.length).fill(0.5))).toBeLessThan(1e-6);
  });
});

describe("the contract inside the model", () => {
  test("is the one the page was built for", () => {
    const { trained_on: _, ...got } = contractOf(model);
    const { trained_on: __, ...built } = {
      ...contract,
      lamps: 3,
      brightness: 0.9,
      mirrored: true,
      heads: expect.arrayContaining(["pitch_rad", "direction_scale"]),
    };
    expect(got).toEqual(built);
  });

  test.each([
    ["cut short", model.subarray(0, 1_000_000), "model-damaged"],
    [
      "a web page",
      new TextEncoder().encode("<!doctype html><title>Not found</title>"),
      "model-damaged",
    ],
    ["empty", new Uint8Array(), "model-damaged"],
    ["of another version", replaced(model, '"version": 3,', '"version": 9,'), "model-version"],
    ["of another mapping", replaced(model, '"mirror ball"', '"mirror-ball"'), "model-version"],
    ["of another unit", replaced(model, '"ln radiance"', '"l2 radiance"'), "model-version"],
    ["not JSON", replaced(model, '"version": 3,', '"version": 3;'), "model-damaged"],
  ])("refuses one that is %s", (_, file, kind) => {
    expect(kindOf(() => contractOf(file))).toBe(kind);
  });
});

describe("the network", () => {
  let network: Network;
  const { height, width, rgb } = want.photo;
  const framing = framePhoto(height, width, undefined, contract);
  const shown = averaged(withAlpha(bytes(rgb)), framing, 40);

  beforeAll(async () => {
    network = await Network.open(model);
  });

  test("is shown what Python shows it", () => {
    const { width: columns, height: rows } = contract;
    const everySixteenth = shown.filter((_, i) => (Math.floor(i / columns) % rows) % 16 === 0);
    expect(largestError(everySixteenth, floats(want.shown_every_16th_row))).toBeLessThan(1e-5);
  });

  test("gives Python's light of a photo within 2e-3 in log radiance", async () => {
    const got = await network.logRadiance(shown);
    expect(largestError(got, floats(want.log_radiance))).toBeLessThan(2e-3);
  });

  test("gives other light when the photo is 2 % brighter", async () => {
    const brighter = shown.map((value) => Math.min(1.02 * (value + 0.5) - 0.5, 0.5));
    expect(
      largestError(await network.logRadiance(brighter), floats(want.log_radiance)),
    ).toBeGreaterThan(4e-3);
  });

  test("refuses a file whose graph is damaged", async () => {
    const damaged = replaced(model, "Conv", "Cone");
    await expect(Network.open(damaged)).rejects.toMatchObject({ kind: "model-damaged" });
  });
});

/** Averages as the worker does, in strips of `rows` rows. */
function averaged(rgba: Uint8ClampedArray, framing: Framing, rows: number): Float32Array {
  const means = new CellMeans(framing);
  const { top, left, width, height } = means;
  for (let row = top; row < top + height; row += rows) {
    const count = Math.min(rows, top + height - row);
    const strip = new Uint8ClampedArray(4 * width * count);
    for (let i = 0; i < count; i++) {
      const start = 4 * ((row + i) * framing.photoWidth + left);
      strip.set(rgba.subarray(start, start + 4 * width), 4 * width * i);
    }
    means.add(strip, row);
  }
  return means.planes(-0.5, 0.5);
}

function withAlpha(rgb: Uint8Array): Uint8ClampedArray {
  const rgba = new Uint8ClampedArray((rgb.length / 3) * 4).fill(255);
  rgb.forEach((value, i) => {
    rgba[4 * Math.floor(i / 3) + (i % 3)] = value;
  });
  return rgba;
}

function asFraming(entries: Record<string, number>): Framing {
  return {
    photoHeight: entries.photo_height!,
    photoWidth: entries.photo_width!,
    top: entries.top!,
    bottom: entries.bottom!,
    left: entries.left!,
    right: entries.right!,
    verticalFovRad: entries.vertical_fov_rad!,
    fovSource: "given",
    inputHeight: entries.input_height!,
    inputWidth: entries.input_width!,
    down: entries.down!,
    aside: entries.aside!,
  };
}

/** The file with the first `old` (ASCII) overwritten by a text of the same length. */
function replaced(file: Uint8Array, old: string, fresh: string): Uint8Array {
  const copy = Buffer.from(file);
  copy.write(fresh, copy.indexOf(old), "latin1");
  return new Uint8Array(copy);
}

function kindOf(act: () => void): string {
  try {
    act();
  } catch (error) {
    return error instanceof EstimateError ? error.kind : String(error);
  }
  return "none";
}
