// Made by tests/golden/make_web.py from the Python package. Do not edit.

export const CONTRACT_KEY = "deeplight.contract" as const;

export const CONTRACT = {
  "version": 3,
  "input_name": "photo",
  "input_layout": "NCHW, RGB, gamma-encoded",
  "width": 135,
  "height": 192,
  "input_low": -0.5,
  "input_high": 0.5,
  "output_name": "log_radiance",
  "output_layout": "NCHW, RGB",
  "output_size": 32,
  "output_quantity": "ln radiance",
  "output_mapping": "mirror ball",
  "output_frame": "camera: +X right, +Y up, +Z towards the camera",
  "output_unit": "1.0 = the camera's white",
  "lamps": 0,
  "lamps_name": "lamps",
  "vertical_fov_deg": 66.0,
  "frame_aspect": 0.5625,
  "background_top": 0.0,
  "background_fraction": 0.8,
  "gamma": 2.2,
  "soft_clip_n": 40.0,
  "reflectivity": {
    "mirror": 0.827,
    "matte_silver": 0.644,
    "diffuse": 0.345
  },
  "trained_on": "",
  "brightness": 0.0,
  "mirrored": false,
  "heads": [],
  "heads_name": "heads"
} as const;

export const SERVED = {
  "input_layout": "NCHW, RGB, gamma-encoded",
  "output_layout": "NCHW, RGB",
  "output_quantity": "ln radiance",
  "output_mapping": "mirror ball",
  "output_frame": "camera: +X right, +Y up, +Z towards the camera",
  "output_unit": "1.0 = the camera's white"
} as const;

export const SINCE_VERSION_2 = {
  "lamps": 0,
  "lamps_name": "lamps",
  "brightness": 0.0
} as const;

export const SINCE_VERSION_3 = {
  "mirrored": false,
  "heads": [],
  "heads_name": "heads"
} as const;

export const LIGHTING_SIZE = 32 as const;

export const CROP_SIZE = 32 as const;

export const ASSUMED_LONG_SIDE_FOV_RAD = 1.1519173063162575 as const;

export const WHOLE_VIEW = 0.995 as const;

export const LEAST_RADIANCE = 1e-06 as const;

export const SLIDE = {
  "FITS": 1.07,
  "LEAST": 1e-06,
  "ROOM": 0.2,
  "FARTHEST": 0.3249196962329063
} as const;

export const AGREEING = {
  "NEARNESS": 8.0,
  "TRUST": 8.0,
  "LEAST_FLUX": 0.0001
} as const;

export const MID_GREY = 118 as const;

export const GAMMA = 2.2 as const;

export const SOFT_CLIP_N = 40.0 as const;

export const LUMINANCE = [
  0.2126,
  0.7152,
  0.0722
] as const;

export const REFLECTIVITY = {
  "mirror": 0.827,
  "matte_silver": 0.644,
  "diffuse": 0.345
} as const;

export const MATTE_SILVER_ROUGHNESS = 0.3 as const;

export const PAPER_RIG = {
  "mirror": {
    "ballFromCamera": [
      0.976813258244,
      0.0,
      -0.214093107126,
      -0.096886079546,
      0.891743192545,
      -0.442048827777,
      0.19091607085,
      0.452541797571,
      0.871066573427
    ],
    "angularRadiusRad": 0.06671614841
  },
  "matte_silver": {
    "ballFromCamera": [
      1.0,
      -0.0,
      0.0,
      0.0,
      0.887388881483,
      -0.461021662203,
      -0.0,
      0.461021662203,
      0.887388881483
    ],
    "angularRadiusRad": 0.06671614841
  },
  "diffuse": {
    "ballFromCamera": [
      0.976813258244,
      -0.0,
      0.214093107126,
      0.096886079546,
      0.891743192545,
      -0.442048827777,
      -0.19091607085,
      0.452541797571,
      0.871066573427
    ],
    "angularRadiusRad": 0.06671614841
  }
} as const;

export const MAIN_LIGHT_CONE_RAD = 0.35 as const;

export const CONDON_SHORTLEY = [
  1.0,
  -1.0,
  1.0,
  -1.0,
  1.0,
  -1.0,
  1.0,
  -1.0,
  1.0
] as const;

export const LATLONG_HEIGHT = 256 as const;

export const LIGHTING_FILE = {
  "format": "deeplight lighting",
  "format_version": 1,
  "frame": "camera: +X right, +Y up, +Z towards the camera; the camera looks along -Z",
  "unit": "linear radiance; 1.0 is the camera's white, where a pixel of the photo just saturates",
  "colour_space": "linear, primaries of Rec. 709 and sRGB, white D65 (lin_rec709)",
  "environment": {
    "files": [],
    "mapping": "equirectangular, top row up (+Y), seen from inside",
    "height": 256,
    "width": 512,
    "made_for": null,
    "view_u": 0.5,
    "axes": "our own"
  },
  "dominant_light": {
    "primary_light_direction": null,
    "primary_light_intensity": null,
    "meaning": "direction: unit vector towards the light; intensity: RGB irradiance on a surface that faces it, radiance unit times sr",
    "share_of_power": null
  },
  "spherical_harmonics": {
    "quantity": "radiance of the whole environment, dominant light included",
    "order": "00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22, each RGB",
    "basis": "orthonormal real harmonics in x, y, z of the frame above",
    "spherical_harmonics_coefficients": null,
    "sign": "all positive (three.js, Ramamoorthi and Hanrahan 2001)",
    "spherical_harmonics_coefficients_condon_shortley": null,
    "sign_condon_shortley": "1, 3, 5 and 7 negated (ARCore, WebXR in Chromium)"
  },
  "mirror_ball": {
    "size": 32,
    "encoding": "base64 of float32, little-endian, rows from the top, RGB",
    "radiance": null
  }
} as const;

export const CONFIDENCE = {
  "DIRECTION_DEG": 18.0,
  "BRIGHTNESS_STOPS": 0.17,
  "FAINT_SHARE": 0.05,
  "CROPS": [
    [
      0.9,
      0.0
    ],
    [
      0.9,
      -0.08
    ],
    [
      0.9,
      0.08
    ]
  ],
  "BLANK_LEVELS": 3.0
} as const;

export const SURENESS_LIMITS = {
  "direction": 60.0,
  "brightness": 0.9,
  "colour": 8.0
} as const;

export const SCENE_FILE = {
  "lamps": {
    "in_environment": true,
    "meaning": "even discs far away; direction: unit vector towards the lamp; flux: RGB radiance integrated over the disc; irradiance: on a surface that faces it, both in the radiance unit times sr; when they are used as lights, the environment must hold the rest only (in_environment false)",
    "lamps": []
  },
  "seen": {
    "height": 64,
    "width": 128,
    "encoding": "base64 of zlib of 8 bits, rows from the top, 255 = the photo shows it; centre column = the view, whatever the environment files are turned for",
    "levels": null
  },
  "itself": "the photo itself",
  "elsewhere": {
    "smooth": "estimated",
    "rows": "estimated, brought to the means of the rows that the photo shows",
    "invented": "estimated, its detail invented"
  }
} as const;

export const TRANSFER = {
  "magic": 1414548548,
  "version": 1,
  "header_bytes": 96,
  "checked_from": 16,
  "flags": {
    "glossy": 1,
    "ground": 2,
    "colours": 4
  },
  "wide_columns": 4,
  "most": {
    "vertices": 100000,
    "triangles": 2000000,
    "ground": 256,
    "clusters": 64,
    "order": 8,
    "number": 1000000
  },
  "ground_middle_step": 0.4
} as const;

export const FUSE = {
  "ROWS": 192,
  "HEIGHT": 512,
  "CELL_ROWS": 64,
  "CELLS": 8192,
  "CLIPPED": 250,
  "DARKEST": 8,
  "FEWEST": 0.9,
  "OUTLIER": 0.15,
  "SCALES": [
    0.8,
    0.4,
    0.2,
    0.15
  ],
  "OVERLAP_SIGMA": 0.02,
  "TIE_SIGMA": 1.0,
  "EXIF_SIGMA": 0.03,
  "SAME_SIGMA": 3.0,
  "INDEPENDENT_SR": 0.05,
  "SHARPNESS": 4,
  "AGREES": 0.8,
  "REACH_PX": 2,
  "EDGE": 0.15,
  "ESTIMATE_ROWS": 64,
  "LEVEL": 0.5,
  "DIM": 1.2,
  "POWER_SIGMA": 0.6,
  "CLIPPED_LOG": 1.4,
  "CLIPPED_SCALE": 0.5,
  "CLIPPED_HIGH_LOG": 2.3,
  "HIGH_FROM": 0.3,
  "HIGH_TO": 0.6,
  "LOG_STEP": 0.025,
  "LOG_STEPS": 400,
  "NEAR": 1.0,
  "LOBE_KAPPA": 250.0,
  "HORIZON": 0.2,
  "FIND_KAPPA": 12.0,
  "FIND_ROWS": 32,
  "STILL_HIDDEN": 0.5,
  "ENOUGH_SEEN": 0.5,
  "ROOM": 0.3,
  "CLEARLY": 1.5,
  "MOST_SHADE": 5.0,
  "MOST_VIEWS": 64,
  "NEAR_RAD": 0.12217304763960307,
  "LIKE_EXPOSURE": 0.5,
  "CHANGED": 0.45,
  "LEAST_OVERLAP_SR": 0.05,
  "MUCH_OVERLAP_SR": 0.15,
  "PATIENCE": 3,
  "VERSION": 1
} as const;

export const PHOTO_LIGHT = {
  "CLIPPED": 0.984313725490196,
  "MOST_SHOWN": 1.05,
  "FEATHER": 0.03,
  "PIXELS_PER_TEXEL": 2,
  "SAMPLES": 2,
  "ROWS": 48,
  "BLUR_RAD": 0.08726646259971647,
  "STAR_BLUR_RAD": 0.2792526803190927,
  "STAR_FROM_RAD": 1.7453292519943295,
  "STAR_TO_RAD": 2.6179938779914944,
  "RING_CELLS": 24,
  "MAP_ROWS": 96,
  "REACH_RAD": 0.9075712110370514,
  "MOST_ADAPTED": 5.298317366548036,
  "DARKEST": 0.001,
  "CONE_RAD": 1.2217304763960306,
  "CONE_EDGE_RAD": 0.3490658503988659,
  "LAMP_RADIUS_RAD": 0.10471975511965978,
  "OWN_RADIUS_RAD": 0.061086523819801536,
  "OWN_COLOUR": 0.25,
  "LARGEST_LAMP_RAD": 0.10471975511965978,
  "ROUND": 0.6,
  "CATCH_RAD": 0.5235987755982988,
  "LARGEST_OWN_RAD": 0.2617993877991494,
  "BRIGHT": [
    0.95,
    1.03
  ],
  "LEAST_LEFT": 0.01,
  "LOBE_END": 0.001,
  "TOGETHER_RAD": 0.2617993877991494,
  "MOST_LAMPS": 3,
  "LEAST_SHARE": 0.03,
  "UNSEEN": 0.02
} as const;

export const CONTINUATION = {
  "BEHIND": 0.8,
  "DOUBT_RAD": 0.2,
  "BLUR_RAD": 0.08726646259971647,
  "DOUBTED": 0.25,
  "BLUR_OF_DOUBT": 1.5,
  "SKY": 0.6,
  "SHOWN": 0.98,
  "LEAST_OF_WIDEST": 0.5,
  "LEAST_TURN_RAD": [
    0.2617993877991494,
    0.7853981633974483
  ],
  "FADE_RAD": 0.17453292519943295,
  "OUTER_RAD": [
    0.17453292519943295,
    0.4363323129985824
  ],
  "EVERY": 2,
  "DARKEST": 0.001,
  "STEEPEST": 0.98
} as const;

export const DETAIL = {
  "DETAIL_ROWS": 128,
  "ROWS": 16,
  "LARGEST_RATIO": 6.0,
  "SURE": 0.75,
  "DARKEST": 0.02,
  "BRIGHTEST": 20.0,
  "SEEN_COUNTS": 3.0,
  "COLOUR_COUNTS": 0.5,
  "STRAY": 0.0001
} as const;

export const UPRIGHT = {
  "SURE_CHANCE": 0.6,
  "LYING_CHANCE": 0.7
} as const;

export const UPRIGHT_EDGES = {
  "SURE_RAD": 0.13962634015954636,
  "LEAST_EVIDENCE": 12.0,
  "HELD_PITCH_RAD": -0.13962634015954636,
  "HELD_SCALE_RAD": 0.3839724354387525,
  "ROLL_RAD": 0.04363323129985824,
  "ROLLED_RAD": 0.17453292519943295,
  "ROLLED": 0.1,
  "SIDE": 256,
  "MOST": 2000,
  "FEWEST": 50,
  "STEEPEST_LEAN": 0.7002075382097097,
  "LEAST_STEP": 5,
  "AGREES_RAD": 0.06981317007977318,
  "SPREAD": 0.05714285714285715,
  "TRUST": 0.3,
  "LEAST_SCALE_RAD": 0.05235987755982989,
  "PITCHES_DEG": [
    -63,
    46,
    3
  ],
  "ROLLS_DEG": [
    -21,
    22,
    3
  ]
} as const;
