import { describe, expect, it } from "vitest";
import { Meter } from "./meter.ts";

describe("Meter", () => {
  it("says that it waits, then the time of one, then the rate too", () => {
    const meter = new Meter();
    expect(String(meter)).toBe("estimating");
    meter.count(0, 30);
    expect(String(meter)).toBe("30 ms");
    for (let i = 1; i <= 50; i++) meter.count(40 * i, 30);
    expect(String(meter)).toBe("30 ms · 25 per second");
    meter.count(4000, 30);
    meter.count(6000, 30);
    expect(String(meter)).toBe("30 ms · 0.5 per second");
    meter.clear();
    expect(String(meter)).toBe("estimating");
  });
});
