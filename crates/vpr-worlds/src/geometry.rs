//! The shapes that scenes are made of, and where rays meet them.

use glam::{Vec2, Vec3};

use crate::noise::value3;

/// A half-line; `direction` has unit length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub(crate) origin: Vec3,
    pub(crate) direction: Vec3,
}

impl Ray {
    pub(crate) fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}

/// A shape in the world frame, metres, z up.
#[derive(Clone, Debug)]
pub(crate) enum Geometry {
    /// A box, turned about the vertical by the angle with this cosine and sine.
    Block { center: Vec3, half: Vec3, turn: Vec2 },
    /// An ellipsoid; with `holes` above zero that share of its surface is missing (leaves).
    Ellipsoid { center: Vec3, radii: Vec3, holes: f32, grain: f32, seed: u32 },
    /// An upright cone frustum without end caps.
    Pillar { base: Vec3, height: f32, bottom: f32, top: f32 },
    /// A parallelogram; seen from both sides.
    Patch { corner: Vec3, u: Vec3, v: Vec3 },
    /// A triangle with a normal per corner.
    Facet { corners: [Vec3; 3], normals: [Vec3; 3] },
}

/// The surface around a hit: an orthonormal frame and metric texture coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    /// To the right as seen from outside.
    pub(crate) u: Vec3,
    /// Upwards as seen from outside.
    pub(crate) v: Vec3,
    /// Outwards.
    pub(crate) normal: Vec3,
    /// Metres from the lower left corner.
    pub(crate) uv: Vec2,
    /// Size of the face in metres.
    pub(crate) extent: Vec2,
    /// Which face of a block: 0 to 3 the sides, 4 the top, 5 the bottom.
    pub(crate) face: u8,
}

impl Geometry {
    /// A block from its centre, its full size and its angle about the vertical in radians.
    pub(crate) fn block(center: Vec3, size: Vec3, angle: f32) -> Self {
        let turn = Vec2::new(libm::cosf(angle), libm::sinf(angle));
        Self::Block { center, half: size * 0.5, turn }
    }

    /// A block from its lowest and highest corner.
    pub(crate) fn span(low: Vec3, high: Vec3) -> Self {
        Self::Block { center: (low + high) * 0.5, half: (high - low) * 0.5, turn: Vec2::X }
    }

    /// A ball without holes.
    pub(crate) fn ball(center: Vec3, radii: Vec3) -> Self {
        Self::Ellipsoid { center, radii, holes: 0.0, grain: 1.0, seed: 0 }
    }

    /// A triangle with one normal, on the side from which its corners run counter-clockwise.
    pub(crate) fn triangle(a: Vec3, b: Vec3, c: Vec3) -> Self {
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
        Self::Facet { corners: [a, b, c], normals: [normal; 3] }
    }

    /// Lowest and highest corner.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        match *self {
            Self::Block { center, half, turn } => {
                let (c, s) = (turn.x.abs(), turn.y.abs());
                let reach = Vec3::new(c * half.x + s * half.y, s * half.x + c * half.y, half.z);
                (center - reach, center + reach)
            }
            Self::Ellipsoid { center, radii, .. } => (center - radii, center + radii),
            Self::Pillar { base, height, bottom, top } => {
                let reach = bottom.max(top);
                let low = base - Vec3::new(reach, reach, 0.0);
                (low, base + Vec3::new(reach, reach, height))
            }
            Self::Patch { corner, u, v } => {
                let corners = [corner, corner + u, corner + v, corner + u + v];
                around(&corners)
            }
            Self::Facet { corners, .. } => around(&corners),
        }
    }

    /// Distance along the ray to the nearest hit closer than `limit`.
    pub(crate) fn hit(&self, ray: &Ray, limit: f32) -> Option<f32> {
        match *self {
            Self::Block { center, half, turn } => {
                let (origin, direction) = into_block(ray, center, turn);
                hit_box(origin, direction, half, limit)
            }
            Self::Ellipsoid { center, radii, holes, grain, seed } => {
                let (near, far) = hit_ellipsoid(ray, center, radii)?;
                let solid =
                    |t: f32| holes <= 0.0 || value3(seed, (ray.at(t) - center) / grain) > holes;
                [near, far].into_iter().find(|&t| t > NEAR && t < limit && solid(t))
            }
            Self::Pillar { base, height, bottom, top } => {
                hit_pillar(ray, base, height, bottom, top, limit)
            }
            Self::Patch { corner, u, v } => {
                let (t, a, b) = hit_plane(ray, corner, u, v)?;
                let inside = (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
                (inside && t > NEAR && t < limit).then_some(t)
            }
            Self::Facet { corners, .. } => {
                let [corner, second, third] = corners;
                let (t, s, r) = hit_plane(ray, corner, second - corner, third - corner)?;
                let inside = s >= 0.0 && r >= 0.0 && s + r <= 1.0;
                (inside && t > NEAR && t < limit).then_some(t)
            }
        }
    }

    /// The surface around a point on this shape; normals face against `direction`.
    pub(crate) fn spot(&self, point: Vec3, direction: Vec3) -> Spot {
        match *self {
            Self::Block { center, half, turn } => spot_on_block(point, center, half, turn),
            Self::Ellipsoid { center, radii, .. } => {
                let normal = ((point - center) / (radii * radii)).normalize_or(Vec3::Z);
                let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
                let size = Vec2::new(2.0 * radii.x, 2.0 * radii.z);
                let local = point - center + radii;
                framed(normal, Vec2::new(local.x + local.y, local.z), size)
            }
            Self::Pillar { base, height, bottom, top } => {
                let outward = Vec3::new(point.x - base.x, point.y - base.y, 0.0);
                let slope = (bottom - top) / height;
                let normal = (outward.normalize_or(Vec3::X) + Vec3::Z * slope).normalize();
                let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
                let around = libm::atan2f(outward.y, outward.x) * bottom;
                framed(normal, Vec2::new(around, point.z - base.z), Vec2::new(6.3 * bottom, height))
            }
            Self::Patch { corner, u, v } => {
                let (length_u, length_v) = (u.length(), v.length());
                let (u, v) = (u / length_u, v / length_v);
                let normal = u.cross(v).normalize();
                let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
                let uv = Vec2::new((point - corner).dot(u), (point - corner).dot(v));
                let extent = Vec2::new(length_u, length_v);
                Spot { u, v, normal, uv, extent, face: 4 }
            }
            Self::Facet { corners, normals } => {
                let [corner, second, third] = corners;
                let (s, r) = barycentric(point, corner, second - corner, third - corner);
                let normal = normals[0] * (1.0 - s - r) + normals[1] * s + normals[2] * r;
                let normal = normal.normalize_or(Vec3::Z);
                let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
                framed(normal, Vec2::new(point.x, point.y), Vec2::ONE)
            }
        }
    }
}

/// Hits nearer than this are the surface the ray starts from.
const NEAR: f32 = 1e-3;

fn around(points: &[Vec3]) -> (Vec3, Vec3) {
    let low = points.iter().fold(Vec3::INFINITY, |low, &point| low.min(point));
    let high = points.iter().fold(Vec3::NEG_INFINITY, |high, &point| high.max(point));
    (low - Vec3::splat(1e-3), high + Vec3::splat(1e-3))
}

fn framed(normal: Vec3, uv: Vec2, extent: Vec2) -> Spot {
    let u = Vec3::Z.cross(normal).normalize_or(Vec3::X);
    Spot { u, v: normal.cross(u), normal, uv, extent, face: 4 }
}

fn turned_back(a: Vec3, turn: Vec2) -> Vec3 {
    Vec3::new(turn.x * a.x + turn.y * a.y, turn.x * a.y - turn.y * a.x, a.z)
}

fn turned(a: Vec3, turn: Vec2) -> Vec3 {
    Vec3::new(turn.x * a.x - turn.y * a.y, turn.x * a.y + turn.y * a.x, a.z)
}

fn into_block(ray: &Ray, center: Vec3, turn: Vec2) -> (Vec3, Vec3) {
    (turned_back(ray.origin - center, turn), turned_back(ray.direction, turn))
}

fn hit_box(origin: Vec3, direction: Vec3, half: Vec3, limit: f32) -> Option<f32> {
    let inverse = direction.recip();
    let first = (-half - origin) * inverse;
    let second = (half - origin) * inverse;
    let near = first.min(second).max_element();
    let far = first.max(second).min_element();
    let t = if near > NEAR { near } else { far };
    (near <= far && t > NEAR && t < limit).then_some(t)
}

fn hit_ellipsoid(ray: &Ray, center: Vec3, radii: Vec3) -> Option<(f32, f32)> {
    let origin = (ray.origin - center) / radii;
    let direction = ray.direction / radii;
    let a = direction.length_squared();
    let b = origin.dot(direction);
    // The closest point to the centre, not b² − ac: that loses all digits far away.
    let nearest = origin - direction * (b / a);
    let rest = 1.0 - nearest.length_squared();
    (rest > 0.0).then(|| {
        let reach = (rest / a).sqrt();
        (-b / a - reach, -b / a + reach)
    })
}

fn hit_pillar(
    ray: &Ray,
    base: Vec3,
    height: f32,
    bottom: f32,
    top: f32,
    limit: f32,
) -> Option<f32> {
    let origin = ray.origin - base;
    let direction = ray.direction;
    let slope = (top - bottom) / height;
    let radius = bottom + slope * origin.z;
    let a = direction.x * direction.x + direction.y * direction.y - (slope * direction.z).powi(2);
    let b = origin.x * direction.x + origin.y * direction.y - slope * direction.z * radius;
    let c = origin.x * origin.x + origin.y * origin.y - radius * radius;
    let root = b * b - a * c;
    if root <= 0.0 || a.abs() < 1e-9 {
        return None;
    }
    let root = root.sqrt();
    let (mut near, mut far) = ((-b - root) / a, (-b + root) / a);
    if near > far {
        (near, far) = (far, near);
    }
    [near, far].into_iter().find(|&t| {
        let z = origin.z + t * direction.z;
        t > NEAR && t < limit && (0.0..=height).contains(&z)
    })
}

/// Distance along the ray and the two coordinates in the plane.
fn hit_plane(ray: &Ray, corner: Vec3, u: Vec3, v: Vec3) -> Option<(f32, f32, f32)> {
    let across = ray.direction.cross(v);
    let determinant = u.dot(across);
    if determinant.abs() < 1e-12 {
        return None;
    }
    let offset = ray.origin - corner;
    let a = offset.dot(across) / determinant;
    let along = offset.cross(u);
    Some((v.dot(along) / determinant, a, ray.direction.dot(along) / determinant))
}

fn barycentric(point: Vec3, a: Vec3, u: Vec3, v: Vec3) -> (f32, f32) {
    let w = point - a;
    let (uu, uv, vv, wu, wv) = (u.dot(u), u.dot(v), v.dot(v), w.dot(u), w.dot(v));
    let determinant = uu * vv - uv * uv;
    ((vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant)
}

fn spot_on_block(point: Vec3, center: Vec3, half: Vec3, turn: Vec2) -> Spot {
    let local = turned_back(point - center, turn);
    let away = (local / half).abs();
    let (face, normal, u, v) = if away.z >= away.x && away.z >= away.y {
        if local.z > 0.0 {
            (4, Vec3::Z, Vec3::X, Vec3::Y)
        } else {
            (5, -Vec3::Z, Vec3::X, -Vec3::Y)
        }
    } else if away.x >= away.y {
        if local.x > 0.0 {
            (0, Vec3::X, Vec3::Y, Vec3::Z)
        } else {
            (1, -Vec3::X, -Vec3::Y, Vec3::Z)
        }
    } else if local.y > 0.0 {
        (2, Vec3::Y, -Vec3::X, Vec3::Z)
    } else {
        (3, -Vec3::Y, Vec3::X, Vec3::Z)
    };
    let (half_u, half_v) = (u.abs().dot(half), v.abs().dot(half));
    Spot {
        uv: Vec2::new(local.dot(u) + half_u, local.dot(v) + half_v),
        extent: Vec2::new(2.0 * half_u, 2.0 * half_v),
        u: turned(u, turn),
        v: turned(v, turn),
        normal: turned(normal, turn),
        face,
    }
}
