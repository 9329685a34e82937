"""How fast `deeplight capture` is on one core, against decoding and dense optical flow alone.

    python benchmarks/capture_speed.py CLIP [--repeat 15] [--workers]

The clip is repeated to a longer one without coding it again. Times are processor time, so that
other programs on the machine matter less. The flow is dense, at the size at which capture looks
at it and at the clip's own, of the luma that FFmpeg decodes, with nothing of DeepLight's. Each
measurement is its own process, with one thread; flow is measured before and after capture, and
the ratio is to the mean. Peak memory is
measured for the clip and for one of a quarter of its length. With --workers the wall time of four
clips is measured too, on one worker and on two: only a quiet machine gives 2.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import av

FLOW = """
import av, cv2, json, numpy, resource, sys, time
from deeplight.capture.motion import WORKING_SIDE
cv2.setNumThreads(1)
flow = cv2.DISOpticalFlow.create(getattr(cv2, "DISOPTICAL_FLOW_PRESET_" + sys.argv[2]))
start, last, count = time.process_time(), None, 0
with av.open(sys.argv[1]) as container:
    video = container.streams.video[0]
    video.codec_context.thread_count = 1
    for frame in container.decode(video):
        luma = numpy.frombuffer(memoryview(frame.planes[0]), numpy.uint8)
        luma = luma.reshape(frame.height, -1)[:, : frame.width]
        if sys.argv[3] == "working":
            shrink = max(1, round(min(luma.shape) / WORKING_SIDE))
            size = frame.width // shrink, frame.height // shrink
            luma = cv2.resize(luma, size, interpolation=cv2.INTER_AREA)
        if last is not None:
            flow.calc(last, luma, None)
        last, count = luma.copy(), count + 1
seconds = time.process_time() - start
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
print(json.dumps({"frames": count, "seconds": seconds, "MB": memory}))
"""

CAPTURE = """
import cv2, json, resource, sys, time
from pathlib import Path
from deeplight.capture.catalogue import find_clips
from deeplight.capture.clip import CaptureSettings
from deeplight.capture.run import capture, plan
from deeplight.jobs import Engine
cv2.setNumThreads(1)
read, kept, workers = [], [], int(sys.argv[3])
def done(outcome):
    assert not outcome.reason, outcome.reason
    read.append(outcome.read), kept.append(outcome.kept)
if __name__ == "__main__":
    start, wall = time.process_time(), time.perf_counter()
    what = plan(find_clips([Path(sys.argv[1])]), Path(sys.argv[2]), CaptureSettings())
    capture(what, Engine(workers=workers), done)
    seconds, wall = time.process_time() - start, time.perf_counter() - wall
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
    counts = {"frames": sum(read), "kept": sum(kept)}
    print(json.dumps({**counts, "seconds": seconds, "wall": wall, "MB": memory}))
"""


def longer(clip: Path, out: Path, times: int) -> Path:
    """The clip several times in a row; its packets are copied."""
    with av.open(str(out), "w") as target:
        stream, shift = None, 0
        for _ in range(times):
            with av.open(str(clip)) as source:
                video = source.streams.video[0]
                stream = stream or target.add_stream_from_template(video)
                end = 0
                for packet in source.demux(video):
                    if packet.dts is None:
                        continue
                    end = max(end, packet.pts + packet.duration)
                    packet.pts, packet.dts, packet.stream = (
                        packet.pts + shift,
                        packet.dts + shift,
                        stream,
                    )
                    target.mux(packet)
                shift += end
    return out


def measured(folder: Path, code: str, *words: str) -> dict[str, float]:
    """Run Python code in its own process; give what it prints."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    program = folder / "program.py"
    program.write_text(code)
    command = [sys.executable, str(program), *words]
    done = subprocess.run(
        command, env={**os.environ, **threads}, stdout=subprocess.PIPE, text=True, check=True
    )
    return json.loads(done.stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("clip", type=Path)
    parser.add_argument("--repeat", type=int, default=15)
    parser.add_argument("--workers", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        long = longer(args.clip, folder / "long.mp4", args.repeat)
        short = longer(args.clip, folder / "short.mp4", max(1, args.repeat // 4))
        kinds = ("FAST", "working"), ("MEDIUM", "working"), ("FAST", "full")
        flows = [[measured(folder, FLOW, str(long), *kind)] for kind in kinds]
        both = [measured(folder, CAPTURE, str(c), str(folder / c.stem), "1") for c in (short, long)]
        for kind, flow in zip(kinds, flows, strict=True):
            flow.append(measured(folder, FLOW, str(long), *kind))
        speed = both[1]["frames"] / both[1]["seconds"]
        print(f"capture: {speed:.1f} frames/s and core")
        for (preset, size), flow in zip(kinds, flows, strict=True):
            alone = sum(one["frames"] for one in flow) / sum(one["seconds"] for one in flow)
            what = f"decoding and DIS flow ({preset}, {size} size)"
            print(f"{what}: {alone:.1f}; ratio {speed / alone:.2f}")
        for one in both:
            counts = f"{one['frames']:.0f} frames, {one['kept']:.0f} kept"
            print(f"  {counts}: {one['seconds']:.1f} s of processor time, peak {one['MB']:.0f} MB")
        if args.workers:
            clips = folder / "clips"
            clips.mkdir()
            for n in range(4):
                longer(args.clip, clips / f"c{n}.mp4", max(1, args.repeat // 4))
            one, two = (
                measured(folder, CAPTURE, str(clips), str(folder / w), w)["wall"] for w in "12"
            )
            print(f"four clips: {one:.1f} s on one worker, {two:.1f} s on two: {one / two:.2f} x")


if __name__ == "__main__":
    main()
