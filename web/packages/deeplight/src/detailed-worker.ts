/** The worker of the page, `deeplight/detailed-worker`: with made-up detail, which the package leaves out. */
import { libraryAt } from "./estimate/detail-library.ts";
import { layDetail } from "./estimate/worker.ts";

layDetail(libraryAt);
