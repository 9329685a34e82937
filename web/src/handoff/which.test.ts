import { describe, expect, test } from "vitest";
import { isPublic, sceneViewerUrl, viewerOf } from "./which.ts";

const ANDROID = "Mozilla/5.0 (Linux; Android 15; Pixel 9) AppleWebKit/537.36 Chrome/140.0 Mobile";

describe("the object goes", () => {
  const on = (userAgent: string, more = {}) =>
    viewerOf({ hasRoom: false, opensUsdz: false, userAgent, ...more });

  test("into the page's own room where there is one, whatever else there is", () => {
    expect(on(ANDROID, { hasRoom: true, opensUsdz: true })).toBeNull();
  });

  test("to Quick Look where links say so, to Scene Viewer on other phones", () => {
    expect(on("iPhone", { opensUsdz: true })).toBe("quick-look");
    expect(on(ANDROID)).toBe("scene-viewer");
  });

  test.each([
    ["a desktop", "Mozilla/5.0 (X11; Linux x86_64) Chrome/140.0"],
    ["Firefox on Android", "Mozilla/5.0 (Android 15; Mobile; rv:140.0) Gecko/140.0 Firefox/140.0"],
    ["a headset", "Mozilla/5.0 (Linux; Android 14; Quest 3) OculusBrowser/38.0 Chrome/140.0"],
  ])("nowhere on %s", (_, userAgent) => {
    expect(on(userAgent)).toBeNull();
  });
});

test.each([
  ["https://light.example/page/", true],
  ["http://light.example/", false],
  ["https://localhost:8765/", false],
  ["https://studio.local:8765/", false],
  ["https://studio:8765/", false],
  ["https://192.168.1.7:8765/", false],
  ["https://[fe80::1]/", false],
  ["https://1and1.example/", true],
])("whether Scene Viewer can fetch from %s", (address, can) => {
  expect(isPublic(new URL(address))).toBe(can);
});

test("Scene Viewer's address holds the file's, whole, and the way back", () => {
  const file = new URL("https://light.example/objects/a b.gltf?x=1&y=2#z");
  const page = new URL("https://light.example/?q=;#end");
  const made = sceneViewerUrl(file, page, "Deep & Light");
  const [address, intent] = made.split("#Intent;") as [string, string];
  const asked = new URL(address.replace("intent:", "https:"));
  expect(asked.host + asked.pathname).toBe("arvr.google.com/scene-viewer/1.2");
  expect(Object.fromEntries(asked.searchParams)).toEqual({
    file: file.href,
    mode: "ar_preferred",
    title: "Deep & Light",
  });
  const said = intent.split(";");
  expect(said.slice(-2)).toEqual(["end", ""]);
  const back = said.find((part) => part.startsWith("S.browser_fallback_url="))!;
  expect(decodeURIComponent(back.split("=")[1]!)).toBe(page.href);
});
