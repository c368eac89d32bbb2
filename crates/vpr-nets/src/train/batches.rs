//! Which images a step sees: a function of the seed and the step alone.

use std::ops::Range;

use rand::{RngExt, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use vpr_core::{Error, Result};

use super::{Album, Batch, augment};

/// Neighbouring places of one album in a step: what a network confuses first.
const NEIGHBOURS: usize = 4;

/// What the images of every album show: each place on as many visits, which lie beside each other,
/// and the places of an avenue behind one another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrangement {
    /// Places of an album.
    pub places: usize,
    /// Images of each of them.
    pub visits: usize,
    /// Avenues of an album: as many places lie on each.
    pub avenues: usize,
}

/// One image of a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chosen {
    /// Its album.
    pub album: usize,
    /// Its number there.
    pub image: usize,
    /// Which of the step's places it shows.
    pub place: usize,
    /// Decides how it is changed.
    pub seed: u64,
}

/// How many images a step sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sizes {
    /// Width and height that the network takes.
    pub input: (usize, usize),
    /// Places, a multiple of four.
    pub places: usize,
    /// Images of each place, at most as many as there were visits.
    pub views: usize,
}

/// Batches by number.
#[derive(Clone, Debug)]
pub struct Batches {
    albums: Vec<Album>,
    arrangement: Arrangement,
    sizes: Sizes,
    seed: u64,
}

impl Arrangement {
    /// Number of images.
    #[must_use]
    pub fn images(&self) -> usize {
        self.places * self.visits
    }

    /// The place that an image shows.
    #[must_use]
    pub fn place(&self, image: usize) -> usize {
        image / self.visits
    }

    fn per_avenue(&self) -> usize {
        self.places / self.avenues.max(1)
    }

    /// Places behind one another on one avenue.
    fn neighbours(&self, random: &mut ChaCha8Rng) -> Range<usize> {
        let avenue = random.random_range(0..self.avenues);
        let first = random.random_range(0..=self.per_avenue() - NEIGHBOURS);
        let first = avenue * self.per_avenue() + first;
        first..first + NEIGHBOURS
    }
}

impl Sizes {
    /// Whether albums of this arrangement give such batches.
    ///
    /// # Errors
    ///
    /// [`Error::Parameter`] with what cannot be.
    pub fn check(&self, arrangement: Arrangement) -> Result<()> {
        let refuse = |name, value: usize, reason| {
            Err(Error::Parameter { name, value: value.to_string(), reason })
        };
        if arrangement.per_avenue() < NEIGHBOURS {
            return refuse("places of an avenue", arrangement.per_avenue(), "must be at least 4");
        }
        if self.places == 0 || !self.places.is_multiple_of(NEIGHBOURS) {
            return refuse("places", self.places, "must be a multiple of 4");
        }
        if !(1..=arrangement.visits).contains(&self.views) {
            return refuse("views", self.views, "must be from 1 to the number of visits");
        }
        if self.input.0.min(self.input.1) < 2 {
            return refuse("input", self.input.0.min(self.input.1), "must be at least 2 pixels");
        }
        Ok(())
    }
}

impl Batches {
    /// Batches from these albums. `seed` decides which images a step sees, and what happens to
    /// them.
    ///
    /// # Errors
    ///
    /// [`Error::Empty`] without albums; [`Error::Mismatch`] if one has not the images of the
    /// arrangement; those of [`Sizes::check`].
    pub fn new(
        albums: Vec<Album>,
        arrangement: Arrangement,
        sizes: Sizes,
        seed: u64,
    ) -> Result<Self> {
        sizes.check(arrangement)?;
        if albums.is_empty() {
            return Err(Error::Empty("albums"));
        }
        let expected = arrangement.images();
        if let Some(album) = albums.iter().find(|album| album.len() != expected) {
            let actual = album.len();
            return Err(Error::Mismatch { what: "images of an album", expected, actual });
        }
        Ok(Self { albums, arrangement, sizes, seed })
    }

    /// The albums.
    #[must_use]
    pub fn albums(&self) -> &[Album] {
        &self.albums
    }

    /// The images of a step: `places × views`, those of a place beside each other.
    #[must_use]
    pub fn chosen(&self, step: usize) -> Vec<Chosen> {
        let mut random = ChaCha8Rng::seed_from_u64(self.seed);
        random.set_stream(step as u64 + 1);
        let mut order: Vec<usize> = (0..self.albums.len()).collect();
        order.shuffle(&mut random);
        let visits = self.arrangement.visits;
        let mut chosen = Vec::new();
        let mut number = 0;
        for album in order.into_iter().cycle().take(self.sizes.places / NEIGHBOURS) {
            for place in self.arrangement.neighbours(&mut random) {
                let mut views: Vec<usize> = (0..visits).collect();
                views.shuffle(&mut random);
                for view in views.into_iter().take(self.sizes.views) {
                    let (image, seed) = (place * visits + view, random.random::<u64>());
                    chosen.push(Chosen { album, image, place: number, seed });
                }
                number += 1;
            }
        }
        chosen
    }

    /// The batch of a step: the images of [`Self::chosen`], changed.
    #[must_use]
    pub fn get(&self, step: usize) -> Batch {
        let (size, chosen) = (self.sizes.input, self.chosen(step));
        let each = 3 * size.0 * size.1;
        let mut images = vec![0.0; each * chosen.len()];
        images.par_chunks_mut(each).zip(&chosen).for_each(|(output, it)| {
            augment(self.albums[it.album].get(it.image), size, it.seed, output);
        });
        Batch { images, size, places: chosen.iter().map(|it| it.place).collect() }
    }
}

/// One variant of every image of an album: `images × 3 × height × width` values in 0 to 1.
#[must_use]
pub fn variants(album: &Album, size: (usize, usize), seed: u64) -> Vec<f32> {
    let each = 3 * size.0 * size.1;
    let mut images = vec![0.0; each * album.len()];
    images.par_chunks_mut(each.max(1)).enumerate().for_each(|(number, output)| {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(number as u64);
        augment(album.get(number), size, random.random::<u64>(), output);
    });
    images
}

#[cfg(test)]
mod tests {
    use sha2::{Digest, Sha256};

    use super::*;

    const CITY: Arrangement = Arrangement { places: 80, visits: 5, avenues: 4 };
    const SIZES: Sizes = Sizes { input: (12, 8), places: 16, views: 3 };

    fn album(factor: usize) -> Album {
        let n = CITY.images() * 3 * 16 * 12;
        #[expect(clippy::cast_possible_truncation, reason = "the lowest byte is wanted")]
        let bytes = (0..n).map(|at| ((at * factor) >> 7) as u8).collect();
        Album::new(bytes, (16, 12)).unwrap()
    }

    fn albums() -> Vec<Album> {
        [2_654_435_761, 40_503, 97].map(album).to_vec()
    }

    fn start_of_digest(values: &[f32]) -> u64 {
        let bytes: Vec<u8> = values.iter().flat_map(|it| it.to_le_bytes()).collect();
        u64::from_be_bytes(*Sha256::digest(&bytes).first_chunk().unwrap())
    }

    #[test]
    fn neighbours_are_on_one_avenue() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..200 {
            let places = CITY.neighbours(&mut random);
            assert_eq!(places.len(), NEIGHBOURS);
            assert_eq!(places.start / 20, (places.end - 1) / 20);
            assert!(places.end <= CITY.places);
        }
    }

    /// Whoever trains with a stated seed gets the images that others had. `sin`, `exp` and `pow`
    /// are the platform's, so the bits are those of one with fused products.
    #[test]
    fn a_seed_gives_the_images_it_has_always_given() {
        let batches = Batches::new(albums(), CITY, SIZES, 7).unwrap();
        let batch = batches.get(11);
        assert_eq!(batch.places, (0..48).map(|image| image / 3).collect::<Vec<_>>());
        assert_eq!(batches.get(11), batch);
        assert_ne!(batches.get(12).images, batch.images);
        #[cfg(all(target_arch = "x86_64", target_os = "linux", target_env = "gnu"))]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            assert_eq!(start_of_digest(&batch.images), 0x3353_80ca_cb6f_19cf);
            assert_eq!(start_of_digest(&variants(&albums()[1], (12, 8), 5)), 0x682d_77f8_d6fa_719d);
        }
    }

    #[test]
    fn what_gives_no_batches_is_refused_by_name() {
        let refused = |albums: Vec<Album>, arrangement, sizes| {
            Batches::new(albums, arrangement, sizes, 1).unwrap_err().to_string()
        };
        for (sizes, part) in [
            (Sizes { places: 6, ..SIZES }, "`places` = 6"),
            (Sizes { places: 0, ..SIZES }, "`places` = 0"),
            (Sizes { views: 6, ..SIZES }, "`views` = 6"),
            (Sizes { views: 0, ..SIZES }, "`views` = 0"),
            (Sizes { input: (1, 8), ..SIZES }, "`input` = 1"),
        ] {
            let text = refused(albums(), CITY, sizes);
            assert!(text.contains(part), "{text}");
        }
        assert!(refused(Vec::new(), CITY, SIZES).contains("albums"));
        let other = Arrangement { visits: 4, ..CITY };
        assert!(refused(albums(), other, SIZES).contains("expected 320, got 400"));
        let crowded = Arrangement { avenues: 40, ..CITY };
        assert!(refused(albums(), crowded, SIZES).contains("avenue"));
        assert!(Album::new(vec![0; 7], (2, 1)).is_err());
        assert!(Album::new(vec![0; 7], (0, 1)).is_err());
    }
}
