/** A worker that gets one job at a time or several, and answers each. */

type Answer<T> =
  | { readonly number: number; readonly made: T }
  | { readonly number: number; readonly failed: string };

export class AskedWorker<Job, Made> {
  private readonly waiting = new Map<number, (answer: Answer<Made>) => void>();
  private count = 0;

  constructor(private readonly worker: Worker) {
    worker.onmessage = ({ data }: MessageEvent<Answer<Made>>) => {
      this.waiting.get(data.number)?.(data);
      this.waiting.delete(data.number);
    };
    worker.onerror = (event) => {
      for (const [number, done] of this.waiting) done({ number, failed: event.message });
      this.waiting.clear();
    };
  }

  /** @throws Error that says what is wrong with the job. */
  ask(job: Job): Promise<Made> {
    const number = this.count++;
    return new Promise((done, failed) => {
      this.waiting.set(number, (answer) => {
        if ("made" in answer) done(answer.made);
        else failed(new Error(answer.failed));
      });
      this.worker.postMessage({ number, job });
    });
  }

  dispose(): void {
    this.worker.terminate();
  }
}

/** The other side: what the worker does with each job. */
export function answer<Job, Made>(make: (job: Job) => Made | Promise<Made>): void {
  self.onmessage = async ({ data }: MessageEvent<{ number: number; job: Job }>) => {
    const { number, job } = data;
    try {
      self.postMessage({ number, made: await make(job) } satisfies Answer<Made>);
    } catch (error) {
      self.postMessage({ number, failed: String(error) } satisfies Answer<Made>);
    }
  };
}
