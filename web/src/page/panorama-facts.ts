/** Metadata by which viewers know a JPEG for a picture of all around: Google's GPano, in XMP. */

const XMP = "http://ns.adobe.com/xap/1.0/\0";
const START = [0xff, 0xd8];
const APP1 = [0xff, 0xe1];

/** The same picture with the facts after its start; any other file as it is. */
export function withPanoramaFacts(
  picture: Uint8Array<ArrayBuffer>,
  { width, height }: { readonly width: number; readonly height: number },
): Uint8Array<ArrayBuffer> {
  if (!START.every((byte, i) => picture[i] === byte)) return picture;
  const facts = {
    ProjectionType: "equirectangular",
    UsePanoramaViewer: "True",
    FullPanoWidthPixels: width,
    FullPanoHeightPixels: height,
    CroppedAreaImageWidthPixels: width,
    CroppedAreaImageHeightPixels: height,
    CroppedAreaLeftPixels: 0,
    CroppedAreaTopPixels: 0,
  };
  const entries = Object.entries(facts).map(([name, value]) => `GPano:${name}="${value}"`);
  const packet =
    `${XMP}<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">` +
    `<rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" ${entries.join(" ")}/>` +
    "</rdf:RDF></x:xmpmeta>";
  const content = new TextEncoder().encode(packet);
  const length = content.length + 2;
  const segment = [...APP1, length >> 8, length & 255];
  return Uint8Array.from([...START, ...segment, ...content, ...picture.subarray(2)]);
}
