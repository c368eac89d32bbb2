//! What a map says about itself: encoder, images, metric, coordinate system.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    str::FromStr,
};

use crate::knn::Metric;

/// What is known of how a map was made; everything is optional, nothing is guessed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct About {
    /// Name of the encoder.
    pub encoder: Option<String>,
    /// Digest of the encoder's weights, such as `sha256:…`.
    pub weights_digest: Option<String>,
    /// Width and height in pixels of the images as the encoder saw them.
    pub image_size: Option<ImageSize>,
    /// How images were resized: `bilinear`, `bicubic`, with or without antialiasing.
    pub interpolation: Option<String>,
    /// The distance the descriptors were made for.
    pub metric: Option<Metric>,
    /// What the numbers of the positions mean.
    pub coordinates: Option<Coordinates>,
}

/// Width and height of an image in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

/// What the numbers of positions mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coordinates {
    /// Metres in a frame of the dataset's own.
    Local,
    /// Metres east and north in one zone of the universal transverse Mercator grid.
    Utm(UtmZone),
}

/// One zone of the universal transverse Mercator grid on one side of the equator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct UtmZone {
    /// 1 to 60, six degrees of longitude each, from 180° west.
    pub number: u8,
    /// Whether it lies south of the equator, where northings start at 10 000 000 m.
    pub south: bool,
}

const ENCODER: &str = "encoder";
const WEIGHTS: &str = "weights_digest";
const SIZE: &str = "image_size";
const INTERPOLATION: &str = "interpolation";
const METRIC: &str = "metric";
const COORDINATES: &str = "coordinates";

impl About {
    /// Adds what is known to the metadata of a file.
    pub fn write_to(&self, metadata: &mut BTreeMap<String, String>) {
        let entries = [
            (ENCODER, self.encoder.clone()),
            (WEIGHTS, self.weights_digest.clone()),
            (SIZE, self.image_size.map(|size| size.to_string())),
            (INTERPOLATION, self.interpolation.clone()),
            (METRIC, self.metric.map(|metric| metric_name(metric).to_owned())),
            (COORDINATES, self.coordinates.map(|coordinates| coordinates.to_string())),
        ];
        for (key, value) in entries {
            if let Some(value) = value {
                metadata.insert(key.to_owned(), value);
            }
        }
    }

    /// What is not as it was, one setting each: `encoder: HOG, was CoHOG`.
    #[must_use]
    pub fn changes_since(&self, before: &Self) -> Vec<String> {
        let [mut now, mut then] = [BTreeMap::new(), BTreeMap::new()];
        self.write_to(&mut now);
        before.write_to(&mut then);
        let keys: BTreeSet<&String> = now.keys().chain(then.keys()).collect();
        let changed = keys.into_iter().filter(|key| now.get(*key) != then.get(*key));
        let line = |key: &String| {
            let said = |of: &BTreeMap<String, String>| {
                of.get(key).cloned().unwrap_or_else(|| "not given".to_owned())
            };
            format!("{key}: {}, was {}", said(&now), said(&then))
        };
        changed.map(line).collect()
    }

    /// Takes what is known from the metadata of a file.
    ///
    /// # Errors
    ///
    /// The key and the reason if a value cannot be understood.
    pub fn read_from(metadata: &BTreeMap<String, String>) -> Result<Self, (String, String)> {
        fn typed<T: FromStr<Err = String>>(
            metadata: &BTreeMap<String, String>,
            key: &str,
        ) -> Result<Option<T>, (String, String)> {
            let parsed = metadata.get(key).map(|text| text.parse()).transpose();
            parsed.map_err(|reason| (format!("metadata `{key}`"), reason))
        }
        let text = |key: &str| metadata.get(key).cloned();
        Ok(Self {
            encoder: text(ENCODER),
            weights_digest: text(WEIGHTS),
            image_size: typed(metadata, SIZE)?,
            interpolation: text(INTERPOLATION),
            metric: metadata
                .get(METRIC)
                .map(|text| parse_metric(text))
                .transpose()
                .map_err(|reason| (format!("metadata `{METRIC}`"), reason))?,
            coordinates: typed(metadata, COORDINATES)?,
        })
    }
}

/// All metrics, by the names that files and flags have for them.
const METRICS: [(&str, Metric); 4] = [
    ("euclidean", Metric::Euclidean),
    ("cosine", Metric::Cosine),
    ("inner-product", Metric::InnerProduct),
    ("manhattan", Metric::Manhattan),
];

/// The name of a metric in files and flags.
#[must_use]
pub fn metric_name(metric: Metric) -> &'static str {
    METRICS.iter().find(|(_, other)| *other == metric).map_or("", |(name, _)| name)
}

/// The metric of this name.
///
/// # Errors
///
/// That there is none, and which there are.
pub fn parse_metric(text: &str) -> Result<Metric, String> {
    METRICS.iter().find(|(name, _)| *name == text).map(|(_, metric)| *metric).ok_or_else(|| {
        let known = METRICS.map(|(name, _)| name).join(", ");
        format!("`{}` is none of {known}", vpr_files::shorten(text))
    })
}

impl fmt::Display for ImageSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

impl FromStr for ImageSize {
    type Err = String;

    /// Reads `640x480`: width, then height.
    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('x').and_then(|(width, height)| {
            Some(Self { width: width.parse().ok()?, height: height.parse().ok()? })
        });
        parsed.ok_or_else(|| format!("`{}` is no WIDTHxHEIGHT", vpr_files::shorten(text)))
    }
}

impl UtmZone {
    /// The zone of a number from 1 to 60 and a latitude band: C to M lie south of the equator, N to X
    /// north. There are no bands I and O.
    ///
    /// A band is not a hemisphere: band S lies north, from 32° to 40°.
    #[must_use]
    pub fn of_band(number: u8, band: char) -> Option<Self> {
        let south = match band.to_ascii_uppercase() {
            'C'..='H' | 'J'..='M' => true,
            'N' | 'P'..='X' => false,
            _ => return None,
        };
        (1..=60).contains(&number).then_some(Self { number, south })
    }
}

impl fmt::Display for UtmZone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.number, if self.south { 'S' } else { 'N' })
    }
}

impl FromStr for UtmZone {
    type Err = String;

    /// Reads `32N` or `32S`: number and hemisphere, not the latitude band.
    fn from_str(text: &str) -> Result<Self, String> {
        let zone = |digits: &str, south| {
            let number = digits.parse().ok().filter(|number| (1..=60).contains(number))?;
            Some(Self { number, south })
        };
        let parsed = match (text.strip_suffix('N'), text.strip_suffix('S')) {
            (Some(digits), _) => zone(digits, false),
            (_, Some(digits)) => zone(digits, true),
            _ => None,
        };
        parsed.ok_or_else(|| {
            let text = vpr_files::shorten(text);
            format!(
                "`{text}` is no UTM zone: a number from 1 to 60, then N or S for the hemisphere"
            )
        })
    }
}

impl fmt::Display for Coordinates {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Local => f.write_str("local"),
            Self::Utm(zone) => write!(f, "utm {zone}"),
        }
    }
}

impl FromStr for Coordinates {
    type Err = String;

    /// Reads `local` or `utm 32N`.
    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("utm ") {
            Some(zone) => zone.parse().map(Self::Utm),
            None if text == "local" => Ok(Self::Local),
            None => {
                Err(format!("`{}` is neither `local` nor `utm ZONE`", vpr_files::shorten(text)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let about = About {
            encoder: Some("NetVLAD".to_owned()),
            image_size: Some(ImageSize { width: 640, height: 480 }),
            metric: Some(Metric::InnerProduct),
            coordinates: Some(Coordinates::Utm(UtmZone { number: 32, south: true })),
            ..About::default()
        };
        let mut metadata = BTreeMap::new();
        about.write_to(&mut metadata);
        assert_eq!(metadata["coordinates"], "utm 32S");
        assert_eq!(About::read_from(&metadata).unwrap(), about);
    }

    #[test]
    fn changes_are_listed_setting_by_setting() {
        let encoder = |name: &str| Some(name.to_owned());
        let before = About { encoder: encoder("HOG"), ..About::default() };
        let coordinates = Some(Coordinates::Local);
        let now = About { encoder: encoder("CoHOG"), coordinates, ..About::default() };
        let expected = ["coordinates: local, was not given", "encoder: CoHOG, was HOG"];
        assert_eq!(now.changes_since(&before), expected);
        assert_eq!(now.changes_since(&now), Vec::<String>::new());
    }

    #[test]
    fn bands_of_one_hemisphere_are_one_zone() {
        let zone = |number, band| UtmZone::of_band(number, band);
        assert_eq!(zone(18, 'S'), zone(18, 'T'));
        assert_eq!(zone(18, 'T'), Some(UtmZone { number: 18, south: false }));
        assert_eq!(zone(18, 'n').unwrap().to_string(), "18N");
        assert_eq!([zone(18, 'M'), zone(18, 'C')], [Some(UtmZone { number: 18, south: true }); 2]);
        for wrong in [zone(0, 'N'), zone(61, 'N'), zone(1, 'I'), zone(1, 'O'), zone(1, 'Y')] {
            assert_eq!(wrong, None);
        }
    }

    #[test]
    fn a_zone_beyond_sixty_is_refused() {
        assert!("61N".parse::<UtmZone>().unwrap_err().contains("`61N` is no UTM zone"));
        assert!("utm 0N".parse::<Coordinates>().is_err());
    }
}
