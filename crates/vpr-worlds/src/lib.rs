//! x
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_possible_wrap, clippy::many_single_char_names, reason = "pixels, lattice cells and f32 geometry")]
mod camera;
mod condition;
mod family;
mod film;
mod geometry;
mod light;
mod material;
mod noise;
mod parts;
mod recipe;
mod render;
mod scene;
mod seed;
pub use camera::Camera;
pub use recipe::Recipe;

pub fn demo(recipe: &Recipe, picks: &[(bool, usize)]) -> Vec<image::RgbImage> {
    use rayon::prelude::*;
    let t = std::time::Instant::now();
    let plan = family::plan(recipe);
    eprintln!("plan {:?} shapes {}", t.elapsed(), plan.scenes[0].shapes.len());
    let t = std::time::Instant::now();
    let out = picks.par_iter().map(|&(q, k)| {
        let shots = if q { &plan.queries } else { &plan.references };
        let shot = &shots[k.min(shots.len() - 1)];
        let light = &plan.lights[shot.light];
        let view = render::View { scene: &plan.scenes[shot.scene], foreground: &shot.foreground, light, camera: &shot.camera, pose: &shot.pose };
        let exposure = render::render(&view);
        shot.film.develop(&exposure.colours, shot.camera.width as usize, light.max_gain, shot.falling, shot.seed)
    }).collect();
    eprintln!("render {} in {:?}", picks.len(), t.elapsed());
    out
}
