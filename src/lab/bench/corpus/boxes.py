#!/usr/bin/env python3
"""Scores tracks and masks of one camera against true boxes (PETS XML).

usage: boxes.py BOXES.xml FIRST LAST [--tracks TRACKS.jsonl] [--masks DIR] [--margin-px 4]
TRACKS.jsonl: one object a line with "frame" (from 0), "id" and "rect" [x, y, width, height] in pixels, as
`videofields segment --tracks` writes them. DIR: masks by frame number from 0, 255 moving, as `--masks` writes them; needs OpenCV.

Prints IDF1 at an intersection over union of 0.5, and the share of moving pixels that lie in no box grown by the margin: what is found
where nobody is, whatever blobs it makes.

IDF1: Ristani, Solera, Zou, Cucchiara and Tomasi 2016, Performance measures and a data set for multi-target, multi-camera tracking.
"""
import argparse
import json
import pathlib
import xml.etree.ElementTree as ElementTree


def boxes_of(path):
    """Returns (id, left, top, right, bottom) by frame."""
    frames = {}
    for frame in ElementTree.parse(path).getroot().iter("frame"):
        boxes = []
        for of in frame.iter("object"):
            box = of.find("box")
            xc, yc, w, h = (float(box.get(key)) for key in ("xc", "yc", "w", "h"))
            boxes.append((of.get("id"), xc - w / 2, yc - h / 2, xc + w / 2, yc + h / 2))
        frames[int(frame.get("number"))] = boxes
    return frames


def tracks_of(path):
    frames = {}
    for line in open(path):
        track = json.loads(line)
        x, y, w, h = track["rect"]
        frames.setdefault(int(track["frame"]), []).append((track["id"], x, y, x + w, y + h))
    return frames


def iou(a, b):
    w = min(a[3], b[3]) - max(a[1], b[1])
    h = min(a[4], b[4]) - max(a[2], b[2])
    if w <= 0 or h <= 0:
        return 0.0
    area = lambda of: (of[3] - of[1]) * (of[4] - of[2])
    return w * h / (area(a) + area(b) - w * h)


def assigned(gains):
    """Returns the greatest sum of one gain a row and column (Kuhn and Munkres, by potentials)."""
    n = max(len(gains), max((len(row) for row in gains), default=0))
    cost = [[-gains[i][j] if i < len(gains) and j < len(gains[i]) else 0 for j in range(n)] for i in range(n)]
    u, v, match, way = [0] * (n + 1), [0] * (n + 1), [0] * (n + 1), [0] * (n + 1)
    for i in range(1, n + 1):
        match[0], j0 = i, 0
        least, used = [float("inf")] * (n + 1), [False] * (n + 1)
        while True:
            used[j0] = True
            i0, delta, j1 = match[j0], float("inf"), 0
            for j in range(1, n + 1):
                if used[j]:
                    continue
                now = cost[i0 - 1][j - 1] - u[i0] - v[j]
                if now < least[j]:
                    least[j], way[j] = now, j0
                if least[j] < delta:
                    delta, j1 = least[j], j
            for j in range(n + 1):
                if used[j]:
                    u[match[j]] += delta
                    v[j] -= delta
                else:
                    least[j] -= delta
            j0 = j1
            if match[j0] == 0:
                break
        while j0:
            match[j0], j0 = match[way[j0]], way[j0]
    return -sum(cost[match[j] - 1][j - 1] for j in range(1, n + 1))


def idf1(truth, tracks, frames):
    together, n_truth, n_tracks = {}, 0, 0
    for i in frames:
        boxes, found = truth.get(i, []), tracks.get(i, [])
        n_truth += len(boxes)
        n_tracks += len(found)
        for box in boxes:
            for track in found:
                if iou(box, track) >= 0.5:
                    together[box[0], track[0]] = together.get((box[0], track[0]), 0) + 1
    rows, columns = sorted({a for a, _ in together}), sorted({b for _, b in together})
    true = assigned([[together.get((a, b), 0) for b in columns] for a in rows]) if together else 0
    return 2 * true / max(1, n_truth + n_tracks)


def outside(truth, folder, frames, margin):
    import cv2

    n_moving = n_outside = n_seen = 0
    for i in frames:
        mask = cv2.imread(str(folder / f"{i:06}.png"), cv2.IMREAD_GRAYSCALE)
        if mask is None:
            continue
        n_seen += 1
        moving = mask == 255
        n_moving += int(moving.sum())
        for _, left, top, right, bottom in truth.get(i, []):
            moving[max(0, int(top - margin)):max(0, int(bottom + margin) + 1), max(0, int(left - margin)):max(0, int(right + margin) + 1)] = False
        n_outside += int(moving.sum())
    if n_seen == 0:
        raise SystemExit(f"{folder}: no masks 000000.png and so on of these frames")
    return n_outside / max(1, n_moving), n_moving


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("boxes")
    parser.add_argument("first", type=int)
    parser.add_argument("last", type=int)
    parser.add_argument("--tracks")
    parser.add_argument("--masks", type=pathlib.Path)
    parser.add_argument("--margin-px", type=float, default=4)
    given = parser.parse_args()
    truth, frames = boxes_of(given.boxes), range(given.first, given.last + 1)
    if given.tracks:
        print(f"IDF1 {idf1(truth, tracks_of(given.tracks), frames):.3f}")
    if given.masks:
        share, n_moving = outside(truth, given.masks, frames, given.margin_px)
        print(f"moving pixels outside of boxes {share:.3f} of {n_moving}")


if __name__ == "__main__":
    main()
