//! Trees, bushes and conifers.

use glam::Vec3;

use crate::{
    geometry::Geometry,
    material::{Material, hue, rgb},
    scene::Draft,
    seed::Seed,
};

/// How a tree grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Species {
    /// Round crown on a trunk.
    Broad,
    /// Tall and narrow.
    Poplar,
    /// A cone of needles.
    Conifer,
    /// No trunk.
    Bush,
}

/// Plants trees into a draft, with shared materials.
pub(crate) struct Grove {
    bark: u32,
    leaves: [u32; 4],
    needles: u32,
    /// Share of leaves that have fallen.
    bare: f32,
}

impl Grove {
    pub(crate) fn new(draft: &mut Draft, seed: Seed, bare: f32) -> Self {
        let trunk = draft.material(Material::Plain { colour: rgb(84, 70, 58), gloss: 0.0 });
        let leaves = std::array::from_fn(|k| {
            let own = seed.named("leaves").at(k as i64);
            let colour = hue(
                own.at(0).range(0.19, 0.3),
                own.at(1).range(0.35, 0.55),
                own.at(2).range(0.34, 0.5),
            );
            draft.material(Material::Foliage { colour, evergreen: false })
        });
        let needles =
            draft.material(Material::Foliage { colour: rgb(44, 74, 50), evergreen: true });
        Self { bark: trunk, leaves, needles, bare }
    }

    /// One plant of this height with its foot at `foot`.
    pub(crate) fn plant(
        &self,
        draft: &mut Draft,
        species: Species,
        foot: Vec3,
        height: f32,
        seed: Seed,
    ) {
        match species {
            Species::Conifer => self.conifer(draft, foot, height, seed),
            Species::Bush => {
                for part in 0..3 {
                    let own = seed.at(part);
                    let r = height * own.at(0).range(0.4, 0.6);
                    let shift =
                        Vec3::new(own.at(1).range(-0.6, 0.6), own.at(2).range(-0.6, 0.6), 0.0);
                    let center = foot + shift * height + Vec3::Z * (0.7 * r);
                    self.crown(draft, center, Vec3::new(r, r, r), seed, own);
                }
            }
            Species::Broad | Species::Poplar => {
                let trunk = height * if species == Species::Broad { 0.38 } else { 0.15 };
                let stem = height * if species == Species::Broad { 0.57 } else { 0.8 };
                let thick = 0.02 * height + 0.03;
                draft.add(
                    Geometry::Pillar { base: foot, height: stem, bottom: thick, top: 0.6 * thick },
                    self.bark,
                    seed.bits(),
                );
                let wide = height
                    * if species == Species::Broad { seed.at(90).range(0.22, 0.32) } else { 0.12 };
                let n = if species == Species::Broad { 12 } else { 8 };
                let tall = if species == Species::Broad { 0.85 } else { 1.5 };
                for part in 0..n {
                    let own = seed.at(part);
                    let level = own.at(0).unit();
                    let spread = wide * (1.0 - 0.6 * (2.0 * level - 0.8).abs());
                    let shift =
                        Vec3::new(own.at(1).range(-1.0, 1.0), own.at(2).range(-1.0, 1.0), 0.0)
                            * spread;
                    let z = trunk + (height - trunk) * (0.15 + 0.75 * level);
                    let r = (0.45 * wide + 0.35) * own.at(3).range(0.8, 1.35);
                    self.crown(
                        draft,
                        foot + shift + Vec3::Z * z,
                        Vec3::new(r, r, r * tall),
                        seed,
                        own,
                    );
                }
            }
        }
    }

    fn conifer(&self, draft: &mut Draft, foot: Vec3, height: f32, seed: Seed) {
        let base = Geometry::Pillar {
            base: foot,
            height: height * 0.3,
            bottom: 0.02 * height,
            top: 0.015 * height,
        };
        draft.add(base, self.bark, seed.bits());
        let wide = height * seed.at(91).range(0.14, 0.22);
        for layer in 0..4_u8 {
            let level = f32::from(layer) / 4.0;
            let base = foot + Vec3::Z * (height * (0.12 + 0.72 * level));
            let bottom = wide * (1.0 - 0.8 * level) * seed.at(i64::from(layer)).range(0.85, 1.15);
            let cone = Geometry::Pillar { base, height: height * 0.3, bottom, top: 0.05 };
            draft.add(cone, self.needles, seed.at(20 + i64::from(layer)).bits());
        }
    }

    fn crown(&self, draft: &mut Draft, center: Vec3, radii: Vec3, tree: Seed, own: Seed) {
        // Without leaves: many small gaps, as between twigs.
        let holes = 0.42 + 0.2 * self.bare;
        let grain = 0.2 * (1.0 - 0.7 * self.bare) * radii.x.clamp(0.7, 2.0);
        let geometry = Geometry::Ellipsoid { center, radii, holes, grain, seed: own.at(7).bits() };
        draft.add(geometry, self.leaves[tree.at(92).index(4)], own.at(8).bits());
    }
}
