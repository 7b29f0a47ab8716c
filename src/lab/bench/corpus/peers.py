"""Scores OpenCV's MOG2 and KNN (shadows on, 5 x 5 median) on one sequence: one JSON line each.

usage: peers.py, with lines "INPUT<tab>TRUTH" on standard input; TRUTH is - where the input is not scored.
"""
import json
import sys
import time

import cv2

cv2.setNumThreads(1)
inputs = [line.rstrip("\n").split("\t") for line in sys.stdin]
for name, model in [
    ("MOG2", cv2.createBackgroundSubtractorMOG2(500, 16, True)),
    ("KNN", cv2.createBackgroundSubtractorKNN(500, 400, True)),
]:
    counts = dict.fromkeys(["hit", "false", "missed", "clear", "shadowed", "turned", "steady"], 0)
    before, cpu_secs = None, 0.0
    for path, truth_path in inputs:
        begun = time.process_time()
        mask = cv2.medianBlur(model.apply(cv2.imread(path)), 5)
        cpu_secs += time.process_time() - begun
        if truth_path == "-":
            before = None
            continue
        truth = cv2.imread(truth_path, 0)
        scored, moving, found = (truth != 85) & (truth != 170), truth == 255, mask == 255
        counts["hit"] += int((found & moving & scored).sum())
        counts["false"] += int((found & ~moving & scored).sum())
        counts["missed"] += int((~found & moving & scored).sum())
        counts["clear"] += int((~found & ~moving & scored).sum())
        counts["shadowed"] += int(((mask == 127) & moving & scored).sum())
        if before is not None:
            steady = scored & before[2] & (moving == before[1])
            counts["steady"] += int(steady.sum())
            counts["turned"] += int((steady & (found != before[0])).sum())
        before = (found, moving, scored)
    print(json.dumps({"name": name, "counts": counts, "cpu_secs": cpu_secs, "n_frames": len(inputs)}))
