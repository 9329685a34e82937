/** The worker in which the network runs: a file of its own, as the content policy wants it. */
import "deeplight/detailed-worker";
