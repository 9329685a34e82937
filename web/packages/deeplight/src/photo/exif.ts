/** The field of view that a JPEG's EXIF data gives, as io/exif.py reads it: the 35 mm equivalent. */

const DIAGONAL_35MM_MM = Math.hypot(36, 24);
const EXIF_IFD = 0x8769;
const FOCAL_LENGTH_35MM = 0xa405;
const SHORT = 3;
const PLAUSIBLE_RAD = [Math.PI / 60, (150 * Math.PI) / 180] as const;

/** Vertical field of view of the upright photo; undefined where the file says nothing plausible. */
export function verticalFovRad(
  file: ArrayBuffer,
  width: number,
  height: number,
): number | undefined {
  const focalMm = focalLength35mm(file);
  if (!focalMm) return undefined;
  const focalPx = (focalMm / DIAGONAL_35MM_MM) * Math.hypot(width, height);
  const fov = 2 * Math.atan(height / 2 / focalPx);
  return fov >= PLAUSIBLE_RAD[0] && fov <= PLAUSIBLE_RAD[1] ? fov : undefined;
}

/** FocalLengthIn35mmFilm in millimetres; undefined where there is none or the data is damaged. */
export function focalLength35mm(file: ArrayBuffer): number | undefined {
  try {
    const tiff = tiffOf(new DataView(file));
    if (!tiff) return undefined;
    const little = tiff.getUint16(0) === 0x4949;
    const exif = entry(tiff, tiff.getUint32(4, little), EXIF_IFD, little);
    const focal = exif && entry(tiff, tiff.getUint32(exif + 8, little), FOCAL_LENGTH_35MM, little);
    if (!focal || tiff.getUint16(focal + 2, little) !== SHORT) return undefined;
    return tiff.getUint16(focal + 8, little) || undefined;
  } catch (error) {
    if (error instanceof RangeError) return undefined; // an offset outside the file
    throw error;
  }
}

/** The TIFF block inside a JPEG's APP1 segment. */
function tiffOf(file: DataView): DataView | undefined {
  if (file.byteLength < 4 || file.getUint16(0) !== 0xffd8) return undefined;
  let at = 2;
  while (at + 4 <= file.byteLength && file.getUint8(at) === 0xff) {
    const marker = file.getUint16(at);
    const length = file.getUint16(at + 2);
    if (marker === 0xffe1 && file.getUint32(at + 4) === 0x45786966) {
      return new DataView(file.buffer, file.byteOffset + at + 10, length - 8);
    }
    if (marker === 0xffda) return undefined; // pixels begin
    at += 2 + length;
  }
  return undefined;
}

/** Where the entry of `tag` lies in the directory at `directory`. */
function entry(
  tiff: DataView,
  directory: number,
  tag: number,
  little: boolean,
): number | undefined {
  const count = tiff.getUint16(directory, little);
  for (let i = 0; i < count; i++) {
    const at = directory + 2 + 12 * i;
    if (tiff.getUint16(at, little) === tag) return at;
  }
  return undefined;
}
