/** The module that runs in the worker: `deeplight/worker`. */
import "./estimate/worker.ts";
