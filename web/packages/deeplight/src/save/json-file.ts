/** The JSON file that `deeplight estimate` writes; `deeplight convert` and `compose` read it. */
import { CONDON_SHORTLEY, LIGHTING_FILE, SCENE_FILE, WHOLE_VIEW } from "../contract/generated.ts";
import type { ModelFacts } from "../estimate/estimator.ts";
import {
  framePhoto,
  hull,
  looks,
  slidIntoPhoto,
  usedFraction,
  visibleFraction,
} from "../estimate/framing.ts";
import { likeliestTurn } from "../estimate/upright.ts";
import { type Environment, resized } from "../light/environment.ts";
import { irradianceOf, type Lamp } from "../light/lamp.ts";
import type { Lighting } from "../light/lighting.ts";

/** Where a light comes from. */
export interface About {
  readonly model: ModelFacts;
  /** Upright; `file` is null for a camera's frame. */
  readonly photo: { readonly file: string | null; readonly width: number; readonly height: number };
  readonly verticalFovRad?: number | undefined;
  /** Names of the environments saved next to it. */
  readonly environments?: readonly string[];
  /** Further lines of what the user should know. */
  readonly notes?: readonly string[];
  /** What the network says of the photo and of itself, by name: `headsIn`. */
  readonly heads?: Readonly<Record<string, number>> | null | undefined;
}

/** What a light holds beyond the ball: see `Environment` and `Lamp`. */
export interface Beyond {
  readonly lamps: readonly Lamp[];
  readonly environment: Environment | null;
}

export function jsonFile(lighting: Lighting, about: About, beyond?: Beyond): Blob {
  const text = `${JSON.stringify(record(lighting, about, beyond), null, 1)}\n`;
  return new Blob([text], { type: "application/json" });
}

export function record(
  lighting: Lighting,
  about: About,
  { lamps, environment }: Beyond = { lamps: [], environment: null },
): Record<string, unknown> {
  return {
    ...LIGHTING_FILE,
    environment: { ...LIGHTING_FILE.environment, files: about.environments ?? [] },
    dominant_light: dominantLight(lighting, lamps[0]),
    spherical_harmonics: harmonics(lighting),
    mirror_ball: {
      ...LIGHTING_FILE.mirror_ball,
      size: lighting.size,
      radiance: base64(bytesOf(lighting.radiance())),
    },
    contract_version: about.model.contract.version,
    model: {
      file: about.model.file,
      sha256: about.model.sha256,
      trained_on: about.model.contract.trained_on,
    },
    photo: { ...about.photo },
    ...framingFacts(about),
    ...(about.heads ? { camera_guess: cameraGuess(about.heads) } : {}),
    ...(environment || lamps.length
      ? { lamps: { ...SCENE_FILE.lamps, lamps: lamps.map(lampEntry) } }
      : {}),
    ...(environment ? { seen: seenEntry(environment) } : {}),
  };
}

/** What the network says of the camera: sureness.py, which says why no more of it. */
function cameraGuess(heads: Readonly<Record<string, number>>): Record<string, unknown> {
  const degrees = (name: string) => (heads[name]! * 180) / Math.PI;
  const { turn, chance } = likeliestTurn(heads);
  return {
    pitch_deg: { value: degrees("pitch_rad"), scale: degrees("pitch_scale") },
    upright_after_turning: { degrees_clockwise: turn, chance },
  };
}

function lampEntry(lamp: Lamp): Record<string, unknown> {
  const { direction, flux, angularRadiusRad } = lamp;
  return { direction, flux, irradiance: irradianceOf(lamp), angular_radius_rad: angularRadiusRad };
}

function seenEntry({ seen, height, detailOf }: Environment): Record<string, unknown> {
  const rows = Math.min(SCENE_FILE.seen.height, height);
  const small = resized(seen, height, rows, 1);
  const levels = Uint8Array.from(small, (share) => Math.floor(255 * share + 0.5));
  const size = { height: rows, width: 2 * rows };
  return { ...SCENE_FILE.seen, ...size, levels: base64(zlibbed(levels)), ...elsewhere(detailOf) };
}

/** What the environment of one photo is where the photo does not look. */
function elsewhere(detailOf?: string | null): Record<string, string> {
  const { itself, elsewhere } = SCENE_FILE;
  if (detailOf === undefined) return {};
  if (detailOf === null) return { elsewhere: elsewhere.smooth };
  if (detailOf === itself) return { elsewhere: elsewhere.rows };
  return { elsewhere: elsewhere.invented, detail_of: detailOf };
}

/** Bytes in zlib's format, as they are: for at most 65,535 of them. */
function zlibbed(bytes: Uint8Array): Uint8Array {
  let [a, b] = [1, 0];
  for (const byte of bytes) {
    a = (a + byte) % 65521;
    b = (b + a) % 65521;
  }
  const length = [bytes.length & 255, bytes.length >> 8];
  const head = [0x78, 0x01, 0x01, ...length, ...length.map((byte) => 255 - byte)];
  return Uint8Array.from([...head, ...bytes, b >> 8, b & 255, a >> 8, a & 255]);
}

/** The first lamp; of a light without lamps what stands out of the ball. */
function dominantLight(lighting: Lighting, lamp?: Lamp): Record<string, unknown> {
  const light = lighting.mainLight(lamp);
  return {
    ...LIGHTING_FILE.dominant_light,
    primary_light_direction: light.direction,
    primary_light_intensity: light.irradiance,
    share_of_power: light.share,
  };
}

function harmonics(lighting: Lighting): Record<string, unknown> {
  const flat = lighting.harmonics(2);
  const coefficients = CONDON_SHORTLEY.map((_, i) => Array.from(flat.slice(3 * i, 3 * i + 3)));
  return {
    ...LIGHTING_FILE.spherical_harmonics,
    spherical_harmonics_coefficients: coefficients,
    spherical_harmonics_coefficients_condon_shortley: coefficients.map((colour, i) =>
      colour.map((value) => value * CONDON_SHORTLEY[i]!),
    ),
  };
}

function framingFacts({ photo, verticalFovRad, model, notes }: About): Record<string, unknown> {
  const centred = framePhoto(photo.height, photo.width, verticalFovRad, model.contract);
  const framing = slidIntoPhoto(centred);
  const visible = visibleFraction(framing);
  const shown = hull(looks(framing));
  const { top, bottom, left, right } = shown;
  const unit = "pixels of the upright photo, from its upper left corner";
  return {
    framing: {
      vertical_fov_deg: (framing.verticalFovRad * 180) / Math.PI,
      fov_source: framing.fovSource,
      visible_fraction: visible,
      used_fraction: usedFraction(shown),
      seen_by_the_network: { top, bottom, left, right, unit },
    },
    notes: [
      ...(notes ?? []),
      ...(framing.fovSource === "assumed" ? ["field of view unknown, assumed"] : []),
      ...(visible < WHOLE_VIEW ? ["the photo shows only part of the trained view"] : []),
    ],
  };
}

/** 32-bit floats, little-endian. */
function bytesOf(values: Float32Array): Uint8Array {
  return new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
}

function base64(bytes: Uint8Array): string {
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}
