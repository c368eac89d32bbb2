//! Latitude and longitude to the universal transverse Mercator grid, and back.

use super::about::UtmZone;
use crate::PlanarPosition;

/// Semi-major axis of WGS 84 in metres.
const AXIS: f64 = 6_378_137.0;
/// Flattening of WGS 84.
const FLATTENING: f64 = 1.0 / 298.257_223_563;
/// Scale on the central meridian of a zone.
const SCALE: f64 = 0.9996;
const FALSE_EASTING: f64 = 500_000.0;
const FALSE_NORTHING: f64 = 10_000_000.0;

/// A point on the WGS 84 ellipsoid, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatLon {
    /// Latitude, north positive.
    pub lat: f64,
    /// Longitude, east positive.
    pub lon: f64,
}

impl LatLon {
    /// The zone this point belongs to, with the exceptions of Norway and Svalbard.
    ///
    /// # Errors
    ///
    /// Why there is none: not on the globe, or too near a pole for the grid.
    pub fn zone(self) -> Result<UtmZone, String> {
        let Self { lat, lon } = self;
        if !(lat.abs() <= 90.0 && (-180.0..=180.0).contains(&lon)) {
            return Err(format!("latitude {lat}, longitude {lon} is no place on earth"));
        }
        if !(-80.0..=84.0).contains(&lat) {
            return Err(format!("latitude {lat} is outside of UTM, which ends at 80° S and 84° N"));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 60")]
        let number = ((lon + 180.0) / 6.0).floor() as u8 % 60 + 1;
        let norway = (56.0..64.0).contains(&lat) && (3.0..12.0).contains(&lon);
        let svalbard = lat >= 72.0 && (0.0..42.0).contains(&lon);
        let number = match lon {
            _ if norway => 32,
            ..9.0 if svalbard => 31,
            ..21.0 if svalbard => 33,
            ..33.0 if svalbard => 35,
            _ if svalbard => 37,
            _ => number,
        };
        Ok(UtmZone { number, south: lat < 0.0 })
    }

    /// Easting and northing in metres in a given zone, by Krüger's series to the sixth order in
    /// the third flattening (Karney, Transverse Mercator with an accuracy of a few nanometers,
    /// Journal of Geodesy 2011): below a micrometre anywhere in the zone and around it.
    #[must_use]
    pub fn to_utm(self, zone: UtmZone) -> PlanarPosition {
        let (sin_lambda, cos_lambda) = (self.lon - central_meridian(zone)).to_radians().sin_cos();
        let tau = conformal(self.lat.to_radians().tan());
        let xi = tau.atan2(cos_lambda);
        let eta = (sin_lambda / tau.hypot(cos_lambda)).asinh();
        let (xi, eta) = add_series(&alpha(), 1.0, xi, eta);
        let radius = SCALE * rectifying_radius();
        let northing = radius * xi + if zone.south { FALSE_NORTHING } else { 0.0 };
        PlanarPosition::new(FALSE_EASTING + radius * eta, northing)
    }

    /// Grid metres per metre on the ground at this point: 0.9996 on the zone's central meridian, 1.001
    /// at its edges on the equator, more beyond. The same in all directions, for the grid is
    /// conformal.
    #[must_use]
    pub fn scale(self, zone: UtmZone) -> f64 {
        const STEP_DEG: f64 = 1e-3;
        let at = |step: f64| Self { lat: self.lat + step, ..self }.to_utm(zone);
        let on_grid = (at(STEP_DEG) - at(-STEP_DEG)).norm();
        let e2 = eccentricity_squared();
        let sin = self.lat.to_radians().sin();
        let meridian_radius = AXIS * (1.0 - e2) / (1.0 - e2 * sin * sin).powf(1.5);
        on_grid / (meridian_radius * (2.0 * STEP_DEG).to_radians())
    }

    /// Degrees of longitude between this point and the central meridian of a zone, 0 to 180.
    #[must_use]
    pub fn degrees_from(self, zone: UtmZone) -> f64 {
        let apart = (self.lon - central_meridian(zone)).rem_euclid(360.0);
        apart.min(360.0 - apart)
    }

    /// The point at an easting and northing in metres of a zone; the inverse of [`Self::to_utm`].
    #[must_use]
    pub fn from_utm(position: PlanarPosition, zone: UtmZone) -> Self {
        let radius = SCALE * rectifying_radius();
        let northing = position.y - if zone.south { FALSE_NORTHING } else { 0.0 };
        let (xi, eta) = (northing / radius, (position.x - FALSE_EASTING) / radius);
        let (xi, eta) = add_series(&beta(), -1.0, xi, eta);
        let conformal_tau = xi.sin() / eta.sinh().hypot(xi.cos());
        let mut tau = conformal_tau;
        for _ in 0..5 {
            let error = conformal(tau) - conformal_tau;
            let e2 = eccentricity_squared();
            let slope = conformal(tau).hypot(1.0) * tau.hypot(1.0) * (1.0 - e2)
                / (1.0 + (1.0 - e2) * tau * tau);
            tau -= error / slope;
        }
        let lambda = eta.sinh().atan2(xi.cos()).to_degrees();
        Self { lat: tau.atan().to_degrees(), lon: central_meridian(zone) + lambda }
    }
}

/// Longitude of the middle of a zone in degrees.
fn central_meridian(zone: UtmZone) -> f64 {
    f64::from(zone.number) * 6.0 - 183.0
}

fn eccentricity_squared() -> f64 {
    FLATTENING * (2.0 - FLATTENING)
}

/// The tangent of the conformal latitude from that of the geographic latitude.
fn conformal(tau: f64) -> f64 {
    let e = eccentricity_squared().sqrt();
    let sigma = (e * (e * tau / tau.hypot(1.0)).atanh()).sinh();
    tau * sigma.hypot(1.0) - sigma * tau.hypot(1.0)
}

/// Powers of the third flattening, from the first to the sixth.
fn powers() -> [f64; 6] {
    let n = FLATTENING / (2.0 - FLATTENING);
    std::array::from_fn(|index| (0..=index).fold(1.0, |product, _| product * n))
}

/// Circumference of the meridian ÷ 2π.
fn rectifying_radius() -> f64 {
    let [n, n2, _, n4, _, n6] = powers();
    AXIS / (1.0 + n) * (1.0 + n2 / 4.0 + n4 / 64.0 + n6 / 256.0)
}

fn add_series(coefficients: &[f64; 6], sign: f64, xi: f64, eta: f64) -> (f64, f64) {
    let (mut new_xi, mut new_eta) = (xi, eta);
    for (order, coefficient) in (1_u8..).zip(coefficients) {
        let twice = 2.0 * f64::from(order);
        new_xi += sign * coefficient * (twice * xi).sin() * (twice * eta).cosh();
        new_eta += sign * coefficient * (twice * xi).cos() * (twice * eta).sinh();
    }
    (new_xi, new_eta)
}

/// Coefficients of the forward series, Karney (35).
fn alpha() -> [f64; 6] {
    let [n, n2, n3, n4, n5, n6] = powers();
    [
        n / 2.0 - 2.0 / 3.0 * n2 + 5.0 / 16.0 * n3 + 41.0 / 180.0 * n4 - 127.0 / 288.0 * n5
            + 7_891.0 / 37_800.0 * n6,
        13.0 / 48.0 * n2 - 3.0 / 5.0 * n3 + 557.0 / 1_440.0 * n4 + 281.0 / 630.0 * n5
            - 1_983_433.0 / 1_935_360.0 * n6,
        61.0 / 240.0 * n3 - 103.0 / 140.0 * n4
            + 15_061.0 / 26_880.0 * n5
            + 167_603.0 / 181_440.0 * n6,
        49_561.0 / 161_280.0 * n4 - 179.0 / 168.0 * n5 + 6_601_661.0 / 7_257_600.0 * n6,
        34_729.0 / 80_640.0 * n5 - 3_418_889.0 / 1_995_840.0 * n6,
        212_378_941.0 / 319_334_400.0 * n6,
    ]
}

/// Coefficients of the inverse series, Karney (36).
fn beta() -> [f64; 6] {
    let [n, n2, n3, n4, n5, n6] = powers();
    [
        n / 2.0 - 2.0 / 3.0 * n2 + 37.0 / 96.0 * n3 - n4 / 360.0 - 81.0 / 512.0 * n5
            + 96_199.0 / 604_800.0 * n6,
        n2 / 48.0 + n3 / 15.0 - 437.0 / 1_440.0 * n4 + 46.0 / 105.0 * n5
            - 1_118_711.0 / 3_870_720.0 * n6,
        17.0 / 480.0 * n3 - 37.0 / 840.0 * n4 - 209.0 / 4_480.0 * n5 + 5_569.0 / 90_720.0 * n6,
        4_397.0 / 161_280.0 * n4 - 11.0 / 504.0 * n5 - 830_251.0 / 7_257_600.0 * n6,
        4_583.0 / 161_280.0 * n5 - 108_847.0 / 3_991_680.0 * n6,
        20_648_693.0 / 638_668_800.0 * n6,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Latitude, longitude, zone, easting, northing of PROJ 9 (`+proj=utm`, EPSG 326xx and 327xx).
    const KNOWN: [(f64, f64, &str, f64, f64); 6] = [
        (37.773_86, -122.435_9, "10N", 549_678.373_352_009_9, 4_180_874.602_438_978_4),
        (52.011_6, 4.357_1, "31N", 593_139.468_903_316, 5_763_197.818_897_061),
        (-33.856_8, 151.215_3, "56S", 334_900.569_652_264_24, 6_252_288.752_888_294),
        (60.39, 5.32, "32N", 297_230.220_209_625_9, 6_700_510.175_253_601),
        (78.22, 15.65, "33N", 514_813.527_263_748_8, 8_683_004.153_277_192),
        (-0.000_1, -79.9, "17S", 622_410.030_006_532_3, 9_999_988.944_944_344),
    ];

    #[test]
    fn agrees_with_proj_to_a_tenth_of_a_micrometre() {
        for (lat, lon, zone, easting, northing) in KNOWN {
            let point = LatLon { lat, lon };
            assert_eq!(point.zone().unwrap().to_string(), zone);
            let position = point.to_utm(point.zone().unwrap());
            let error = (position - PlanarPosition::new(easting, northing)).norm();
            assert!(error < 1e-7, "{lat} {lon}: off by {error} m");
        }
    }

    #[test]
    fn back_and_forth_gives_the_point_back() {
        for (lat, lon, ..) in KNOWN {
            let point = LatLon { lat, lon };
            let zone = point.zone().unwrap();
            let back = LatLon::from_utm(point.to_utm(zone), zone);
            assert!((back.lat - lat).abs() < 1e-12 && (back.lon - lon).abs() < 1e-12, "{back:?}");
        }
    }

    /// Snyder, Map Projections (1987), equation 8-11, in terms of the latitude: good to 1e-8 within
    /// a few degrees of the meridian.
    fn series_scale(lat: f64, degrees: f64) -> f64 {
        let (sin, cos) = lat.to_radians().sin_cos();
        let second = eccentricity_squared() / (1.0 - eccentricity_squared());
        let (t, c) = ((sin / cos).powi(2), second * cos * cos);
        let a = degrees.to_radians() * cos;
        let fourth = 5.0 - 4.0 * t + 42.0 * c + 13.0 * c * c - 28.0 * second;
        let sixth = 61.0 - 148.0 * t + 16.0 * t * t;
        let series =
            (1.0 + c) * a.powi(2) / 2.0 + fourth * a.powi(4) / 24.0 + sixth * a.powi(6) / 720.0;
        SCALE * (1.0 + series)
    }

    #[test]
    fn the_scale_is_that_of_snyders_series() {
        let zone = UtmZone { number: 31, south: false };
        for (lat, lon) in [(0.0, 3.0), (0.0, 6.0), (51.4779, -0.0005), (-40.0, 4.5), (60.0, 9.0)] {
            let point = LatLon { lat, lon };
            let error = point.scale(zone) - series_scale(lat, lon - 3.0);
            assert!(error.abs() < 2e-8, "{lat} {lon}: off by {error}");
        }
        let edge = LatLon { lat: 0.0, lon: 0.0 }.scale(zone);
        assert!((edge - 1.000_98).abs() < 1e-5, "{edge}");
    }

    #[test]
    fn degrees_are_counted_the_short_way_round() {
        let first = UtmZone { number: 1, south: false };
        let from = |lon| LatLon { lat: 0.0, lon }.degrees_from(first);
        assert_eq!([from(-177.0), from(-180.0), from(179.0), from(3.0)], [0.0, 3.0, 4.0, 180.0]);
    }

    #[test]
    fn poles_and_places_off_the_globe_have_no_zone() {
        assert!(LatLon { lat: 85.0, lon: 0.0 }.zone().unwrap_err().contains("outside of UTM"));
        assert!(LatLon { lat: 91.0, lon: 0.0 }.zone().unwrap_err().contains("no place on earth"));
        assert!(LatLon { lat: f64::NAN, lon: 0.0 }.zone().is_err());
        assert_eq!(LatLon { lat: 0.0, lon: 180.0 }.zone().unwrap().number, 1);
    }
}
