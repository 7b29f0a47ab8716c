//! Hard cases of numbers, each by name, against a truth in f64 with a bound; pictures by `sound`: every pixel is written,
//! none is NaN.
//!
//! | case | test here | elsewhere |
//! |---|---|---|
//! | point on, before, behind a camera's plane | projection::a_point_on_just_before_and_behind_a_cameras_plane, pictures::points_on_before_and_behind_a_cameras_plane_are_drawn_as_the_twin_projects_them | |
//! | texel on the horizon, 1e-6 above | projection::a_texel_on_the_horizon_and_a_millionth_above_it | mapping::tests::a_texel_above_the_horizon_has_no_entry |
//! | grazing rays of 0.01 degrees | projection::a_foot_seen_at_a_hundredth_of_a_degree_lies_where_it_stands, pictures::ground_seen_at_a_hundredth_of_a_degree_begins_where_its_edge_is | surface::tests::far::grazing_rays_meet_where_they_graze, mapping::tests::grazing_rays_are_marked_and_theta_is_the_angle_to_the_ground |
//! | eye on the ground | pictures::an_eye_on_the_ground_sees_what_stands_on_it | render::hard_views_give_finite_pictures |
//! | eye inside a building | pictures::an_eye_inside_a_building_sees_its_walls_from_within | |
//! | eye inside a billboard | entities::an_eye_inside_a_billboard_draws_all_else_as_without_it | |
//! | eye at a camera's centre | pictures::an_eye_exactly_at_a_cameras_centre_sees_as_the_twin | render::a_view_from_a_cameras_place_shows_its_picture |
//! | straight up and down | projection::straight_up_and_straight_down_north_is_on_top, pictures::straight_up_and_straight_down_match_the_twin | |
//! | two cameras at one place, one direction | projection::two_cameras_at_one_place_and_with_one_direction_are_one, pictures::two_cameras_at_one_place_count_alike | patches::tests::cameras_calibrated_alike_are_known_once_and_listed_each |
//! | all weights zero | weights::where_all_weights_are_zero_the_camera_shows_to_its_border_and_the_material_beyond | |
//! | a weight next to nothing, denormal | weights::a_camera_that_counts_next_to_nothing_leaves_the_other_and_shows_alone, entities::a_second_source_of_denormal_weight_changes_nothing | render::the_smallest_weights_still_blend |
//! | entity rectangle without width | entities::a_rectangle_without_width_is_no_entity, entities::a_rectangle_without_width_or_height_draws_nothing | |
//! | touching each border | entities::who_touches_a_border_of_the_picture_stands_where_they_stand, entities::who_touches_a_border_is_drawn_as_the_camera_shows_them | |
//! | feet beyond the horizon | entities::feet_beyond_the_horizon_and_behind_the_eye_draw_nothing | fuse::feet_that_meet_nothing_or_a_wall_stay_finite |
//! | larger than the picture | entities::somebody_larger_than_the_picture_fills_it | |
//! | origin at (5e5, 5e6, 300) and 1e7 | pictures::pictures_at_map_coordinates_and_at_ten_thousand_kilometres_are_those_at_the_origin | fuse::tests, geometry::a_texel_s_ray_comes_back_to_it |
//! | scenes of 1 cm and of 100 km | pictures::scenes_of_a_centimetre_and_of_a_hundred_kilometres_match_the_twin | surface::tests::far::scenes_of_a_centimetre_and_of_a_hundred_kilometres_are_met |
//! | coplanar walls | projection::coplanar_walls_are_one_wall_to_every_ray, pictures::coplanar_walls_that_cameras_see_do_not_flicker_between_frames, pictures::of_coplanar_walls_of_two_materials_the_later_is_seen | |
//! | distortion beyond its fold | projection::beyond_a_barrels_fold_nothing_is_located, pictures::ground_beyond_a_barrels_fold_is_not_shown | geometry::what_lies_far_beyond_the_lens_lands_nowhere |
//! | focal length of 1 px and 1e6 px | projection::focal_lengths_of_one_and_of_a_million_pixels, pictures::cameras_of_one_pixels_and_of_a_million_pixels_focal_length_match_the_twin | |
//! | quaternion of length 1 +- 1e-3, and 0 | projection::a_quaternion_a_thousandth_too_long_or_short_is_normalised_and_none_is_refused | |
//! | 1e5 entities | entities::a_hundred_thousand_entities_behind_the_eye_leave_the_one_before_it | fuse::tests::a_hundred_cameras_over_a_crowd_stay_bounded |
//! | NaN: cameras, shapes | not_numbers::cameras_and_shapes_that_carry_a_nan_are_refused | geometry::no_point_and_no_texture_yields_nan |
//! | NaN: feet, heights, points | not_numbers::entities_whose_feet_and_heights_are_no_numbers_are_not_drawn, not_numbers::points_that_are_no_numbers_are_not_drawn | fuse::tests::feet_of_which_nothing_is_known_stay_apart_and_finite |
//! | NaN: gains | not_numbers::gains_at_their_limits_give_what_light_times_gain_gives, not_numbers::gains_that_are_no_numbers_or_below_zero_change_nothing | fuse::exposure::pictures_of_noise_give_finite_gains_within_bounds |
//! | NaN: times of the cost table | | plan::tests::what_is_no_time_never_enters_the_model |
//! | cut faces | cracks::no_sky_shines_through_cut_faces | patches::tests::solids_stay_closed_to_the_last_bit_however_they_are_cut |

#[path = "numerics/cracks.rs"]
mod cracks;
#[path = "numerics/entities.rs"]
mod entities;
#[path = "numerics/not_numbers.rs"]
mod not_numbers;
#[path = "numerics/pictures.rs"]
mod pictures;
#[path = "numerics/projection.rs"]
mod projection;
#[path = "numerics/weights.rs"]
mod weights;

use crate::render::stage::{SKY, Stage};
use crate::render::twin;
use crate::render::{BLUE, Brush, GREEN, RED, check_twin, draw, keep, pixel, plaza, renderer, v, view};
use videofields_picture::fuse::SceneState;
use videofields_picture::plan::EntityStyle;
use videofields_render::View;
use videofields_vision::frame::RgbImage;

/// Draws a picture, then another over the same memory, then the first again: both are the same, so that every pixel was
/// written; and none is black, as NaN is in bytes.
fn sound(brush: &mut Brush, state: &SceneState, view: &View, style: EntityStyle) -> RgbImage {
    let first = draw(brush, state, view, style).0.image;
    let nothing = SceneState { entities: Vec::new(), points: Vec::new(), ..state.clone() };
    let up = View {
        pose: videofields_vision::geometry::Pose { world_from_local: glam::DQuat::IDENTITY, ..view.pose },
        ..*view
    };
    draw(brush, &nothing, &up, EntityStyle::None);
    let again = draw(brush, state, view, style).0.image;
    assert_eq!(first, again, "drawn twice, twice the same");
    assert!(!first.data.chunks_exact(3).any(|pixel| pixel == [0; 3]), "no pixel is black");
    first
}
