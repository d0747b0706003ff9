//! A pinhole camera and the rays of its pixels.

use glam::{Quat, Vec3};

/// Largest distance of the camera's elevation from the poles while orbiting, in radians.
const POLE_MARGIN_RAD: f32 = 0.02;
/// Distance from a point to which zooming takes the eye at most, in the scene's unit.
const FARTHEST: f32 = 1e7;

/// Look-at camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Eye, in world space.
    pub eye: Vec3,
    /// Point in the middle of the picture.
    pub target: Vec3,
    /// Which way is up; need not be perpendicular to the viewing direction.
    pub up: Vec3,
    /// Field of view across the shorter side of the picture, degrees, 0.1 to 170.
    pub fov_deg: f32,
}

/// A camera made ready for one picture size. Twin of the camera fields of `Frame` in `scene.wgsl`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraFrame {
    /// Eye, in world space.
    pub eye: Vec3,
    /// Unit vector into the picture.
    pub forward: Vec3,
    /// From the picture's middle to its right edge, at distance 1.
    pub right: Vec3,
    /// From the picture's middle to its top edge, at distance 1.
    pub up: Vec3,
    /// Pixels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl CameraFrame {
    /// Returns the width of a pixel at distance 1.
    pub fn pixel_width(&self) -> f32 {
        2.0 * self.up.length() / self.height as f32
    }
}

impl Camera {
    /// Makes a camera in `direction` (from the object to the eye) of a sphere, far enough to see all of it.
    pub fn framing(centre: Vec3, radius: f32, direction: Vec3, fov_deg: f32) -> Camera {
        const MARGIN: f32 = 1.08;
        let distance = MARGIN * radius.max(1e-6) / (fov_deg.to_radians() * 0.5).sin();
        Camera { eye: centre + direction.normalize() * distance, target: centre, up: Vec3::Y, fov_deg }
    }

    /// Returns the reason why this camera cannot be used, if there is one.
    pub fn fault(&self) -> Option<&'static str> {
        let finite = self.eye.is_finite() && self.target.is_finite() && self.up.is_finite();
        let forward = self.target - self.eye;
        if !finite {
            Some("the camera has a coordinate that is not a finite number")
        } else if forward.length() < 1e-9 {
            Some("the camera's eye and target are the same point")
        } else if forward.normalize().cross(self.up.normalize_or_zero()).length() < 1e-6 {
            Some("the camera's up vector is zero or parallel to its viewing direction")
        } else if !(0.1..=170.0).contains(&self.fov_deg) {
            Some("the camera's fov_deg is not within 0.1 to 170")
        } else {
            None
        }
    }

    /// Returns the camera for a picture of `width` x `height` pixels, both at least 1.
    pub fn frame(&self, width: u32, height: u32) -> CameraFrame {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        let up = right.cross(forward);
        let scale = (self.fov_deg.to_radians() * 0.5).tan() / width.min(height) as f32;
        CameraFrame {
            eye: self.eye,
            forward,
            right: right * (scale * width as f32),
            up: up * (scale * height as f32),
            width,
            height,
        }
    }

    /// Turns the eye about the target: to the right by `yaw_rad`, upwards by `pitch_rad`. Stops short of the poles.
    pub fn orbit(&mut self, yaw_rad: f32, pitch_rad: f32) {
        self.orbit_about(self.target, yaw_rad, pitch_rad);
    }

    /// Turns eye and target about `pivot`, which stays at its place in the picture: to the right by `yaw_rad`, upwards by
    /// `pitch_rad`. Stops short of the poles.
    pub fn orbit_about(&mut self, pivot: Vec3, yaw_rad: f32, pitch_rad: f32) {
        let offset = self.eye - self.target;
        let pole = self.up.normalize();
        let elevation = pole.dot(offset.normalize()).clamp(-1.0, 1.0).asin();
        let limit = std::f32::consts::FRAC_PI_2 - POLE_MARGIN_RAD;
        let pitch = (elevation + pitch_rad).clamp(-limit, limit) - elevation;
        let right = pole.cross(offset).normalize();
        let turn = Quat::from_axis_angle(pole, yaw_rad) * Quat::from_axis_angle(right, -pitch);
        // The target from the eye, not both from the pivot: far from it their difference would lose its last places.
        self.eye = pivot + turn * (self.eye - pivot);
        self.target = if pivot == self.target { pivot } else { self.eye - turn * offset };
    }

    /// Brings the eye nearer to `point` along the straight way, or farther from it: multiplies their distance by
    /// `factor`, but comes no nearer than `nearest`. The point stays at its place in the picture, the viewing direction
    /// stays, and the target moves to the point's depth. Points beside or behind the eye change nothing.
    pub fn zoom_about(&mut self, point: Vec3, factor: f32, nearest: f32) {
        let forward = (self.target - self.eye).normalize();
        let way = self.eye - point;
        let distance = way.length();
        // An eye that is nearer already stays.
        let factor = if factor < 1.0 { factor.max(nearest / distance).min(1.0) } else { factor };
        let depth = -factor * way.dot(forward);
        if depth > 0.0 && distance * factor < FARTHEST {
            self.eye = point + way * factor;
            self.target = self.eye + forward * depth;
        }
    }

    /// Turns the view about the eye: to the right by `yaw_rad`, upwards by `pitch_rad`. Stops short of the poles.
    pub fn look(&mut self, yaw_rad: f32, pitch_rad: f32) {
        // The target goes round the eye as the eye goes round the target.
        let mut other = Camera { eye: self.target, target: self.eye, ..*self };
        other.orbit(-yaw_rad, pitch_rad);
        self.target = other.eye;
    }

    /// Moves eye and target by `x` to the right, `y` upwards and `z` forwards, in the picture's axes.
    pub fn fly(&mut self, [x, y, z]: [f32; 3]) {
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        let shift = right * x + right.cross(forward) * y + forward * z;
        self.eye += shift;
        self.target += shift;
    }

    /// Moves eye and target so that the picture moves by a fraction of its shorter side (x right, y up).
    pub fn pan(&mut self, x: f32, y: f32) {
        let offset = self.eye - self.target;
        let size = 2.0 * offset.length() * (self.fov_deg.to_radians() * 0.5).tan();
        let right = self.up.cross(offset).normalize();
        let up = offset.normalize().cross(right);
        let shift = -(right * x + up * y) * size;
        self.eye += shift;
        self.target += shift;
    }
}

impl CameraFrame {
    /// Returns where a point is seen, pixels from the picture's top left corner; `None` behind the eye.
    pub fn pixel_of(&self, point: Vec3) -> Option<[f32; 2]> {
        let towards = point - self.eye;
        let depth = towards.dot(self.forward);
        (depth > 1e-6).then(|| {
            let x = towards.dot(self.right) / (depth * self.right.length_squared());
            let y = towards.dot(self.up) / (depth * self.up.length_squared());
            [0.5 * (1.0 + x) * self.width as f32, 0.5 * (1.0 - y) * self.height as f32]
        })
    }

    /// Returns the unit direction of the ray through pixel (`x`, `y`), row 0 at the top, moved by `jitter` pixels from
    /// the pixel's middle. Twin: `camera_direction` in `shader.wgsl`.
    pub fn direction(&self, x: u32, y: u32, jitter: [f32; 2]) -> Vec3 {
        let px = 2.0 * (x as f32 + 0.5 + jitter[0]) / self.width as f32 - 1.0;
        let py = 1.0 - 2.0 * (y as f32 + 0.5 + jitter[1]) / self.height as f32;
        (self.forward + self.right * px + self.up * py).normalize()
    }
}

/// Returns where sample `index` of a pixel lies, as an offset from its middle in -0.5 to 0.5: sample 0 in the middle,
/// the others on the R2 low-discrepancy sequence [Roberts 2018], so that a picture of one frame is unjittered.
pub fn jitter(index: u32) -> [f32; 2] {
    // 1/g and 1/g^2 of the plastic number g = 1.32471795724...
    const STEP: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
    STEP.map(|step| ((0.5 + step * f64::from(index)).fract() - 0.5) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera { eye: Vec3::new(0.0, 0.0, 5.0), target: Vec3::ZERO, up: Vec3::Y, fov_deg: 40.0 }
    }

    #[test]
    fn picture_has_x_to_the_right_and_row_zero_at_the_top() {
        let frame = camera().frame(200, 100);
        let top_left = frame.direction(0, 0, [0.0; 2]);
        let bottom_right = frame.direction(199, 99, [0.0; 2]);
        assert!(top_left.x < 0.0 && top_left.y > 0.0 && top_left.z < 0.0);
        assert!((bottom_right.x + top_left.x).abs() < 1e-6 && (bottom_right.y + top_left.y).abs() < 1e-6);
        let frame = camera().frame(101, 101);
        assert!((frame.direction(50, 50, [0.0; 2]) - Vec3::NEG_Z).length() < 1e-6);
    }

    #[test]
    fn field_of_view_spans_the_shorter_side() {
        for (width, height) in [(300, 100), (100, 300)] {
            let frame = camera().frame(width, height);
            let short = if width < height { frame.right } else { frame.up };
            assert!((short.length() - 20f32.to_radians().tan()).abs() < 1e-6);
            assert!((frame.right.length() / frame.up.length() - width as f32 / height as f32).abs() < 1e-5);
        }
    }

    #[test]
    fn framing_keeps_the_whole_sphere_in_the_picture() {
        let camera = Camera::framing(Vec3::new(1.0, 2.0, 3.0), 2.0, Vec3::new(1.0, 1.0, 1.0), 30.0);
        let half_angle = (2.0 / (camera.eye - camera.target).length()).asin();
        assert!(half_angle < 15f32.to_radians());
    }

    #[test]
    fn orbit_keeps_the_distance_and_stops_before_the_poles() {
        let mut camera = camera();
        for _ in 0..100 {
            camera.orbit(0.3, 0.2);
        }
        assert!(((camera.eye - camera.target).length() - 5.0).abs() < 1e-3);
        assert_eq!(camera.fault(), None);
        assert!(camera.eye.y > 4.9);
        let before = camera.eye;
        camera.orbit(0.5, 0.0);
        assert!((camera.eye - before).length() > 1e-3);
    }

    #[test]
    fn orbiting_about_a_point_keeps_it_at_its_place_in_the_picture() {
        let pivot = Vec3::new(1.0, 0.5, 1.0);
        let mut turned = camera();
        let place = |camera: &Camera| glam::Vec2::from(camera.frame(300, 200).pixel_of(pivot).unwrap());
        let (distance, seen_at) = (turned.eye.distance(pivot), place(&turned));
        turned.orbit_about(pivot, 0.4, 0.3);
        assert!((turned.eye.distance(pivot) - distance).abs() < 1e-4);
        assert!(place(&turned).distance(seen_at) < 0.01);
        assert!((turned.eye.distance(turned.target) - 5.0).abs() < 1e-4);
        // The target is no fixed point of this turn, as it is of a turn about itself.
        assert!(turned.target.length() > 0.3);
        let mut about_target = camera();
        about_target.orbit(0.4, 0.3);
        assert!(about_target.target == Vec3::ZERO && place(&about_target).distance(seen_at) > 5.0);
        let forwards = [turned, about_target].map(|camera| camera.frame(10, 10).forward);
        assert!(forwards[0].distance(forwards[1]) < 1e-5);
        for _ in 0..100 {
            turned.orbit_about(pivot, 0.1, 0.2);
        }
        assert_eq!(turned.fault(), None);
    }

    #[test]
    fn zooming_keeps_the_point_at_its_place_and_stops_before_it() {
        let point = Vec3::new(0.8, -0.6, 1.0);
        let (mut zoomed, start) = (camera(), camera());
        let pixel = |camera: &Camera| camera.frame(300, 200).pixel_of(point).unwrap();
        for clicks in 1..=100 {
            let before = zoomed.eye.distance(point);
            zoomed.zoom_about(point, 0.8, 0.01);
            let distance = zoomed.eye.distance(point);
            assert!((distance - (0.8 * before).max(0.01)).abs() < 1e-5, "click {clicks}: {distance}");
            let moved = pixel(&zoomed).iter().zip(pixel(&start)).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(moved < 0.1, "click {clicks}: {moved} pixels");
            assert!(zoomed.frame(1, 1).forward.distance(start.frame(1, 1).forward) < 1e-4);
        }
        assert_eq!(zoomed.fault(), None);
        // The target is as deep as the point.
        let frame = zoomed.frame(1, 1);
        assert!((frame.forward.dot(point - zoomed.eye) - zoomed.eye.distance(zoomed.target)).abs() < 1e-5);
        // Out again, along the same way.
        zoomed.zoom_about(point, 100.0, 0.01);
        assert!((zoomed.eye - point).normalize().distance((start.eye - point).normalize()) < 1e-3);
        assert!((zoomed.eye.distance(point) - 1.0).abs() < 1e-3);
        // A point behind the eye is no place to go to, and nothing is farther than the farthest.
        let before = zoomed;
        zoomed.zoom_about(before.eye - before.frame(1, 1).forward, 0.5, 0.01);
        zoomed.zoom_about(point, 1e9, 0.01);
        assert_eq!(zoomed, before);
    }

    #[test]
    fn a_point_is_seen_where_its_ray_goes_through() {
        let frame = Camera { eye: Vec3::new(1.0, 2.0, 5.0), ..camera() }.frame(200, 120);
        for (x, y) in [(0, 0), (150, 30), (199, 119)] {
            let [px, py] = frame.pixel_of(frame.eye + frame.direction(x, y, [0.0; 2]) * 7.0).unwrap();
            assert!((px - x as f32 - 0.5).abs() < 1e-2 && (py - y as f32 - 0.5).abs() < 1e-2, "{px} {py}");
        }
        assert_eq!(frame.pixel_of(frame.eye - frame.forward), None);
    }

    #[test]
    fn looking_keeps_the_eye_and_flying_the_view() {
        let mut camera = camera();
        camera.look(0.3, 0.2);
        assert!(camera.eye == Vec3::new(0.0, 0.0, 5.0) && camera.target.x > 0.1 && camera.target.y > 0.1);
        assert!((camera.target - camera.eye).length() - 5.0 < 1e-4);
        let before = camera.target - camera.eye;
        camera.fly([0.0, 0.0, 2.0]);
        assert!((camera.target - camera.eye - before).length() < 1e-5);
        assert!((camera.eye - Vec3::new(0.0, 0.0, 5.0) - before.normalize() * 2.0).length() < 1e-5);
    }

    #[test]
    fn refuses_cameras_that_look_nowhere() {
        let mut same = camera();
        same.target = same.eye;
        assert!(same.fault().is_some());
        let mut along = camera();
        along.up = Vec3::Z;
        assert!(along.fault().is_some());
        let mut nan = camera();
        nan.eye.x = f32::NAN;
        assert!(nan.fault().is_some());
        assert_eq!(camera().fault(), None);
    }

    #[test]
    fn first_sample_is_in_the_middle_and_the_others_spread_over_the_pixel() {
        assert_eq!(jitter(0), [0.0, 0.0]);
        let mean: f32 = (0..1000).map(|i| jitter(i)[0]).sum::<f32>() / 1000.0;
        assert!(mean.abs() < 0.01);
        assert!((1..1000).all(|i| jitter(i).iter().all(|x| (-0.5..=0.5).contains(x)) && jitter(i) != [0.0, 0.0]));
    }
}
