/** Milliseconds and frames per second, over the last second. */
export class Meter {
  private readonly times: number[] = [];
  private ms = 0;

  /** One estimate more. */
  count(nowMs: number, tookMs: number): void {
    this.times.push(nowMs);
    // Two stay however far apart, so that a slow device has a rate too.
    while (this.times.length > 2 && nowMs - this.times[0]! > 1000) this.times.shift();
    this.ms = this.times.length === 1 ? tookMs : this.ms + 0.2 * (tookMs - this.ms);
  }

  clear(): void {
    this.times.length = 0;
  }

  get estimatesPerSecond(): number {
    const span = this.times.at(-1)! - this.times[0]!;
    return span > 0 ? ((this.times.length - 1) * 1000) / span : 0;
  }

  toString(): string {
    if (!this.times.length) return "estimating";
    const ms = `${this.ms.toFixed(this.ms < 10 ? 1 : 0)} ms`;
    const rate = this.estimatesPerSecond;
    return rate > 0 ? `${ms} · ${rate.toFixed(rate < 10 ? 1 : 0)} per second` : ms;
  }
}
