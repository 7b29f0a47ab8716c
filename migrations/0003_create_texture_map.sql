-- Texture-to-world maps; a cache, rebuilt in seconds from calibration and surfaces.
create table texture_map (
    -- SHA-256 of all that the map was built from.
    digest blob not null primary key check (length(digest) = 32),
    -- The scene and the camera that it was built for last.
    scene text not null check (length(scene) between 1 and 64),
    camera text not null check (length(camera) between 1 and 64),
    -- When it was built: nanoseconds since 1970-01-01, UTC.
    created_at integer not null,
    -- Order of use: greater is later. A count and not a time, because clocks step.
    used integer not null,
    -- The encoded map. Last, so that the other columns are read without it.
    bytes blob not null
) strict;

create index texture_map_by_scene_and_camera on texture_map (scene, camera);
create index texture_map_by_use on texture_map (used);
