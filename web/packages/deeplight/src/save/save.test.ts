/** Files as `deeplight estimate` writes them; tests/parity/test_web_files.py reads them in Python. */
import { mkdirSync, writeFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { floats, golden, largestError } from "../../../../tests/golden.ts";
import { decodedHdr } from "../../../../tests/hdr.ts";
import { CONTRACT, SCENE_FILE } from "../contract/generated.ts";
import type { Environment } from "../light/environment.ts";
import { Lighting } from "../light/lighting.ts";
import { encodedHdr, hdrFile } from "./hdr-file.ts";
import { type About, jsonFile, record } from "./json-file.ts";

const want = golden("photo");
const scenes = golden("scene");
const lighting = new Lighting(floats(want.record_log_radiance));
const about: About = {
  model: {
    file: "deeplight.onnx",
    sha256: want.model_sha256,
    contract: { ...CONTRACT, trained_on: want.record.model.trained_on },
  },
  photo: { file: null, width: want.photo.width, height: want.photo.height },
  environments: ["photo.exr"],
  heads: headsOf(want.record.camera_guess),
};

/** What the network must have said for Python's guess. */
// biome-ignore lint/suspicious/noExplicitAny: a record of Python's
function headsOf({ pitch_deg: pitch, upright_after_turning: upright }: any) {
  const { degrees_clockwise: turn, chance } = upright;
  const others = { upright_0: 0, upright_90: 0, upright_180: 0, upright_270: 0 };
  const radians = (degrees: number) => (degrees * Math.PI) / 180;
  const heads = { pitch_rad: radians(pitch.value), pitch_scale: radians(pitch.scale) };
  return { ...others, [`upright_${turn}`]: chance, ...heads };
}

describe("the JSON file", () => {
  test("has Python's entries and numbers", () => {
    const got = JSON.parse(JSON.stringify(record(lighting, about)));
    const expected = want.record;
    expect(Object.keys(got)).toEqual(Object.keys(expected));
    const { notes: _, mirror_ball: ball, ...rest } = got;
    const { notes: __, mirror_ball: wantBall, ...wanted } = expected;
    expect(shape(rest)).toEqual(shape(wanted));
    expect(largestError(numbers(rest), numbers(wanted))).toBeLessThan(2e-4);
    expect({ ...ball, radiance: undefined }).toEqual({ ...wantBall, radiance: undefined });
    expect(got.notes).toHaveLength(want.record.notes.length);
  });

  test("has the first lamp as its main light, where lamps are known", () => {
    const lamp = {
      direction: [0, 0.6, 0.8],
      flux: [0.2, 0.1, 0.1],
      angularRadiusRad: 0.1,
    } as const;
    const got = record(lighting, about, { lamps: [lamp], environment: null });
    const light = got.dominant_light as Record<string, unknown>;
    expect(light.primary_light_direction).toEqual(lamp.direction);
    const [listed] = (got.lamps as { lamps: { irradiance: number[] }[] }).lamps;
    expect(light.primary_light_intensity).toEqual(listed!.irradiance);
    expect(light.share_of_power).toBeGreaterThan(0);
    expect(light.share_of_power).toBeLessThan(1);
  });

  test.each(["lamps", "upright", "indoor"])("says what is not seen as Python, case %s", (name) => {
    const { elsewhere } = scenes[name];
    const itself = name === "lamps" ? null : SCENE_FILE.itself;
    const environment = {
      radiance: new Float32Array(24),
      height: 2,
      seen: new Float32Array(8),
      detailOf: elsewhere.detail_of ?? itself,
    };
    const of = (one: Environment) => record(lighting, about, { lamps: [], environment: one }).seen;
    expect(of(environment)).toMatchObject(elsewhere);
    const { detailOf: _, ...gathered } = environment;
    expect(of(gathered)).not.toHaveProperty("elsewhere");
  });

  test("holds the ball exactly", () => {
    const text = (record(lighting, about) as { mirror_ball: { radiance: string } }).mirror_ball
      .radiance;
    expect(floats({ shape: [3072], float32: text })).toEqual(lighting.radiance());
  });
});

describe("the .hdr file", () => {
  const width = 16;
  const values = Float32Array.from({ length: 3 * width * 4 }, (_, i) =>
    i < 60 ? 0.25 : 10 ** ((i % 13) - 6) * (1 + (i % 7)),
  );

  test("steps by at most 1/128 of a pixel's largest channel", () => {
    const got = decodedHdr(encodedHdr(values, width));
    values.forEach((value, i) => {
      const pixel = values.subarray(i - (i % 3), i - (i % 3) + 3);
      expect(Math.abs(got[i]! - value)).toBeLessThanOrEqual(Math.max(...pixel) / 128);
    });
  });

  test("keeps powers of two, black and very bright light", () => {
    const exact = new Float32Array(3 * 8).fill(0);
    exact.set([1, 0.5, 2 ** -10, 65536, 4, 2 ** 20]);
    const got = decodedHdr(encodedHdr(exact, 8));
    expect([got[0], got[1], got[3], got[5], got[6]]).toEqual([1, 0.5, 65536, 2 ** 20, 0]);
  });

  test("is 256 x 512", async () => {
    const text = await hdrFile(lighting).slice(0, 80).text();
    expect(text).toMatch(/^#\?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 256 \+X 512\n/);
  });
});

test("both are left for Python where it asks for them", async () => {
  const folder = process.env.DEEPLIGHT_WEB_FILES;
  const files = { "web.hdr": hdrFile(lighting), "web.json": jsonFile(lighting, about) };
  for (const [name, blob] of Object.entries(files)) {
    expect(blob.size).toBeGreaterThan(10_000);
    if (folder === undefined) continue;
    mkdirSync(folder, { recursive: true });
    writeFileSync(`${folder}/${name}`, new Uint8Array(await blob.arrayBuffer()));
  }
});

/** The structure with every number replaced, to compare words and nesting. */
function shape(value: unknown): unknown {
  if (typeof value === "number") return "a number";
  if (Array.isArray(value)) return value.map(shape);
  if (value === null || typeof value !== "object") return value;
  return Object.fromEntries(Object.entries(value).map(([key, entry]) => [key, shape(entry)]));
}

function numbers(value: unknown): number[] {
  if (typeof value === "number") return [value];
  return value === null || typeof value !== "object" ? [] : Object.values(value).flatMap(numbers);
}
