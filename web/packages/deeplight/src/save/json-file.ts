/** The JSON file that `deeplight estimate` writes; `deeplight convert` and `compose` read it. */
import { CONDON_SHORTLEY, LIGHTING_FILE, WHOLE_VIEW } from "../contract/generated.ts";
import type { ModelFacts } from "../estimate/estimator.ts";
import { framePhoto, usedFraction, visibleFraction } from "../estimate/framing.ts";
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
}

export function jsonFile(lighting: Lighting, about: About): Blob {
  const text = `${JSON.stringify(record(lighting, about), null, 1)}\n`;
  return new Blob([text], { type: "application/json" });
}

export function record(lighting: Lighting, about: About): Record<string, unknown> {
  return {
    ...LIGHTING_FILE,
    environment: { ...LIGHTING_FILE.environment, files: about.environments ?? [] },
    dominant_light: dominantLight(lighting),
    spherical_harmonics: harmonics(lighting),
    mirror_ball: {
      ...LIGHTING_FILE.mirror_ball,
      size: lighting.size,
      radiance: base64(lighting.radiance()),
    },
    contract_version: about.model.contract.version,
    model: {
      file: about.model.file,
      sha256: about.model.sha256,
      trained_on: about.model.contract.trained_on,
    },
    photo: { ...about.photo },
    ...framingFacts(about),
  };
}

function dominantLight(lighting: Lighting): Record<string, unknown> {
  const light = lighting.mainLight();
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
  const framing = framePhoto(photo.height, photo.width, verticalFovRad, model.contract);
  const visible = visibleFraction(framing);
  const { top, bottom, left, right } = framing;
  const unit = "pixels of the upright photo, from its upper left corner";
  return {
    framing: {
      vertical_fov_deg: (framing.verticalFovRad * 180) / Math.PI,
      fov_source: framing.fovSource,
      visible_fraction: visible,
      used_fraction: usedFraction(framing),
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
function base64(values: Float32Array): string {
  const bytes = new Uint8Array(values.buffer, values.byteOffset, values.byteLength);
  return btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
}
