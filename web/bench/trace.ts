/** Processor time of threads, out of what Chromium notes of its tasks. */
export interface TraceEvent {
  readonly name: string;
  readonly ph: string;
  readonly pid: number;
  readonly tid: number;
  /** Microseconds of processor time. */
  readonly tdur?: number;
  readonly args: { readonly name?: string };
}

/** Milliseconds of processor time in the tasks of each of the renderer's threads. */
export function threadTimes(events: readonly TraceEvent[]): Map<string, number> {
  const key = ({ pid, tid }: TraceEvent): string => `${pid}/${tid}`;
  const named = events.filter(({ ph, name }) => ph === "M" && name === "thread_name");
  const names = new Map(named.map((event) => [key(event), event.args.name!]));
  const times = new Map<string, number>();
  for (const event of events) {
    if (event.ph !== "X" || !event.name.endsWith("RunTask")) continue;
    const thread = names.get(key(event)) ?? "";
    times.set(thread, (times.get(thread) ?? 0) + (event.tdur ?? 0) / 1000);
  }
  return times;
}
