// Metrics are read, and rates and means made of two readings.

import { expect, test } from "vitest";
import { compared } from "./health";
import { mean, parse, rate, sum } from "./prometheus";

const TEXT = `# HELP videofields_api_requests_total Answered requests.
# TYPE videofields_api_requests_total counter
videofields_api_requests_total{route="/api/v1/cameras",status="200"} 12
videofields_api_requests_total{route="(none)",status="404"} 3
videofields_api_request_seconds_bucket{route="(none)",le="+Inf"} 2
videofields_render_picture_seconds_sum 1.5
videofields_render_picture_seconds_count 10
odd{name="a \\"b\\", c=\\"d\\""} 1e3
`;

const at = (seconds: number, text: string) => ({ at: seconds * 1e3, metrics: parse(text) });

test("samples are read with their labels, buckets left out", () => {
  const metrics = parse(TEXT);
  expect([...metrics.keys()]).toEqual(["videofields_api_requests_total", "videofields_render_picture_seconds_sum", "videofields_render_picture_seconds_count", "odd"]);
  expect(sum(metrics, "videofields_api_requests_total")).toBe(15);
  expect(sum(metrics, "videofields_api_requests_total", { status: "404" })).toBe(3);
  expect(metrics.get("odd")).toEqual([{ labels: { name: 'a "b", c="d"' }, value: 1_000 }]);
  expect(sum(metrics, "none")).toBe(0);
});

test("rates and means are of what came between two readings", () => {
  const [before, now] = [at(0, TEXT), at(5, TEXT.replace("sum 1.5", "sum 2.5").replace("count 10", "count 20").replace("} 12", "} 22"))];
  expect(rate((metrics) => sum(metrics, "videofields_api_requests_total"), before, now)).toBe(2);
  const of = (name: string) => (metrics: Parameters<typeof sum>[0]) => sum(metrics, name);
  const [total, count] = [of("videofields_render_picture_seconds_sum"), of("videofields_render_picture_seconds_count")];
  expect(mean(total, count, before, now)).toBe(100);
  expect(mean(total, count, now, now)).toBeNull();
  // A daemon that was started again counts from nothing.
  expect(rate(count, now, before)).toBeNull();
});

test("a camera's changes of state are told once", () => {
  const cameras = [{ id: "north", word: "live", since: "2026-03-01T12:00:00Z", reason: null }];
  expect(compared(new Map(), cameras, 5)).toEqual([{ camera: "north", from: null, to: "live", at: Date.parse("2026-03-01T12:00:00Z"), reason: null }]);
  expect(compared(new Map([["north", "live"]]), cameras, 5)).toEqual([]);
  expect(compared(new Map([["north", "stale"]]), cameras, 5)).toMatchObject([{ from: "stale", to: "live", at: 5 }]);
});
