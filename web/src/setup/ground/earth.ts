// Where the scene's origin lies on the earth: degrees and metres (WGS 84), in the plane that touches the ellipsoid there.

import type { Corner } from "../plan/frame";

export type Origin = { readonly latitude_deg: number; readonly longitude_deg: number; readonly height_m?: number };

const SEMI_MAJOR_M = 6_378_137;
const SQUARED_ECCENTRICITY = (2 - 1 / 298.257223563) / 298.257223563;
const DEG = Math.PI / 180;
const ROUNDS = 6;

type Geocentric = readonly [number, number, number];

function primeRadius(latitude: number): number {
  return SEMI_MAJOR_M / Math.sqrt(1 - SQUARED_ECCENTRICITY * Math.sin(latitude) ** 2);
}

function geocentric({ latitude_deg, longitude_deg, height_m = 0 }: Origin): Geocentric {
  const [latitude, longitude] = [latitude_deg * DEG, longitude_deg * DEG];
  const radius = primeRadius(latitude);
  const around = (radius + height_m) * Math.cos(latitude);
  return [around * Math.cos(longitude), around * Math.sin(longitude), (radius * (1 - SQUARED_ECCENTRICITY) + height_m) * Math.sin(latitude)];
}

/** The place on the earth that lies so many metres east and north of the origin. */
export function onEarth(origin: Origin, [east, north]: Corner): Origin {
  const [sine, cosine] = [Math.sin(origin.latitude_deg * DEG), Math.cos(origin.latitude_deg * DEG)];
  const [sideways, ahead] = [Math.sin(origin.longitude_deg * DEG), Math.cos(origin.longitude_deg * DEG)];
  const [ox, oy, oz] = geocentric(origin);
  const x = ox - sideways * east - sine * ahead * north;
  const y = oy + ahead * east - sine * sideways * north;
  const z = oz + cosine * north;
  const around = Math.hypot(x, y);
  let latitude = Math.atan2(z, around * (1 - SQUARED_ECCENTRICITY));
  let height = 0;
  for (let round = 0; round < ROUNDS; round += 1) {
    const radius = primeRadius(latitude);
    height = around / Math.cos(latitude) - radius;
    latitude = Math.atan2(z, around * (1 - (SQUARED_ECCENTRICITY * radius) / (radius + height)));
  }
  return { latitude_deg: latitude / DEG, longitude_deg: Math.atan2(y, x) / DEG, height_m: height };
}

/** What 100 m are in degrees there. */
export function hundredMetres(origin: Origin): { longitudeDeg: number; latitudeDeg: number } {
  return {
    longitudeDeg: onEarth(origin, [100, 0]).longitude_deg - origin.longitude_deg,
    latitudeDeg: onEarth(origin, [0, 100]).latitude_deg - origin.latitude_deg,
  };
}

/** One number in degrees: 52.0903, 52°5'25.1"N, N 52 5 25.1. */
function degrees(text: string): number | null {
  const numbers = [...text.matchAll(/-?\d+(?:\.\d+)?/g)].map(([digits]) => Number(digits));
  const [whole, minutes = 0, seconds = 0] = numbers;
  if (whole === undefined || numbers.length > 3 || minutes < 0 || minutes >= 60 || seconds < 0 || seconds >= 60) return null;
  const size = Math.abs(whole) + minutes / 60 + seconds / 3_600;
  return /[SW]/i.test(text) || whole < 0 ? -size : size;
}

/** Latitude and longitude as maps print them; null of what is neither. */
export function readPlace(text: string): { latitude_deg: number; longitude_deg: number } | null {
  const halves = /^([^,;]+)[,;]\s*([^,;]+)$/.exec(text.trim()) ?? /^(\S+)\s+(\S+)$/.exec(text.trim());
  if (!halves) return null;
  const [latitude, longitude] = [degrees(halves[1] ?? ""), degrees(halves[2] ?? "")];
  if (latitude === null || longitude === null || Math.abs(latitude) > 90 || Math.abs(longitude) > 180) return null;
  return { latitude_deg: latitude, longitude_deg: longitude };
}
