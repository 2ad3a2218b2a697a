"""The loop of a renderer's child process: reads requests as lines of JSON, answers in lines of JSON.

    {"load": "cornell", "folder": …}          → {"seconds": {"start": …, "load": …}, "version": …}
    {"render": …, "spp": 16, "seed": 1, "image": "x.npy"} → {"seconds": {"compile": …, "render": …}}

One process serves one scene and waits between requests, so renderers take turns without starting anew each time.
"""

import json
import os
import sys
import time

import numpy

RESOLUTION = 256
# Seeds from here on belong to references.
REFERENCE_SEED = 500_000


def serve(make_renderer, started: float) -> None:
    # Blender and LLVM print to descriptor 1; the answers get one of their own, everything else goes to stderr.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    renderer = make_renderer()
    start = time.time() - started
    for line in sys.stdin:
        request = json.loads(line)
        if "load" in request:
            renderer.prepare(request["load"], request["folder"], request.get("resolution", RESOLUTION),
                             request.get("options", {}))
            before = time.perf_counter()
            renderer.load()
            answer = {"seconds": {"start": start, "load": time.perf_counter() - before}, "version": renderer.version}
        else:
            image, seconds = renderer.render(request["spp"], request["seed"])
            numpy.save(request["image"], numpy.asarray(image, numpy.float32))
            answer = {"seconds": seconds}
        print(json.dumps(answer), file=answers, flush=True)
