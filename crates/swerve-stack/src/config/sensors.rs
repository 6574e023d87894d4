//! Radars and lidars on the ego vehicle, `[radar.NAME]` and `[lidar.NAME]`, and common parts of all sensors.

use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::{Ego, Lidar, Point, Transform};
use swerve_lidar::{Beam, LidarEngine, LidarPreset, LidarSpec};
use swerve_sim::sense::{Radar, RadarParams, RadarPreset, SensorMount, SensorTiming};
use swerve_text::number;
use swerve_vehicle::{Shape, VehicleParams};

use crate::problems::{problem, problems_of_ranges};

/// Problems, by key.
type Faults = Vec<(String, String)>;

/// One radar.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct RadarConfig {
    /// Class of radar.
    pub preset: RadarPreset,
    /// Parameters that differ from the preset.
    #[schemars(with = "RadarParams")]
    pub params: toml::Table,
    /// Position in the ego frame, m; the middle of the front bumper, 0.5 m up, when absent.
    pub at_m: Option<[f64; 3]>,
    /// Yaw, degrees; positive to the left.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
    /// Time between two scans, ms; the preset's when absent.
    #[schemars(range(min = 1.0, max = 60_000.0))]
    pub period_ms: Option<f64>,
    /// Time for which echoes are gathered, ms; the stamp is its middle.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub exposure_ms: f64,
    /// Read-out time of a scan, ms.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub readout_ms: f64,
    /// Time from the read-out to the reader, ms.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub transfer_ms: f64,
}

impl RadarConfig {
    /// Radar on this vehicle.
    pub fn radar(&self, vehicle: &VehicleParams) -> Result<Radar, Faults> {
        Ok(Radar::new(self.params()?, self.mount(&vehicle.shape), vehicle))
    }

    /// Time between two scans, ms.
    pub fn period_ms(&self) -> f64 {
        self.period_ms.unwrap_or_else(|| self.preset.period().as_secs() * 1e3)
    }

    /// Times from exposure to the reader.
    pub fn timing(&self) -> SensorTiming {
        let &Self { exposure_ms, readout_ms, transfer_ms, .. } = self;
        SensorTiming { exposure_ms, readout_ms, transfer_ms, rolling: false }
    }

    /// Pose on the vehicle.
    pub fn mount(&self, shape: &Shape) -> SensorMount {
        let front = SensorMount::front(shape);
        let [x_m, y_m, z_m] = self.at_m.unwrap_or([front.x_m, front.y_m, front.z_m]);
        SensorMount { x_m, y_m, z_m, yaw_rad: self.yaw_deg.to_radians() }
    }

    fn params(&self) -> Result<RadarParams, Faults> {
        let params = overridden(&self.preset.params(), &self.params, &[("preset", "preset")])?;
        let told: Faults =
            params.problems().into_iter().map(|error| problem(error.under("params"))).collect();
        if told.is_empty() { Ok(params) } else { Err(told) }
    }

    pub(crate) fn faults(&self, shape: &Shape) -> Faults {
        let mut told = self.params().err().unwrap_or_default();
        told.extend(problems_of_ranges(self));
        told.extend(mount_faults(&self.mount(shape), shape));
        told
    }
}

/// One lidar.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct LidarConfig {
    /// Class of lidar.
    pub preset: LidarPreset,
    /// Ray caster: `cpu`, the same points on every machine, or `gpu`, worthwhile from 64 beams on.
    pub engine: LidarEngine,
    /// Parameters that differ from the preset.
    #[schemars(with = "LidarSpec")]
    pub params: toml::Table,
    /// Elevation and azimuth offset of each laser, degrees; the preset's when empty.
    pub beams_deg: Vec<[f64; 2]>,
    /// Rotation rate, turns per second; the preset's when absent.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub rate_hz: Option<f64>,
    /// Position in the ego frame, m; above the middle of the roof, 1.9 m up or 0.1 m above a higher roof, when absent.
    pub at_m: Option<[f64; 3]>,
    /// Roll about the forward axis, degrees; positive leans right.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub roll_deg: f64,
    /// Pitch, degrees; positive downwards.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub pitch_deg: f64,
    /// Yaw, degrees; positive to the left.
    #[schemars(range(min = -360.0, max = 360.0))]
    pub yaw_deg: f64,
    /// Read-out time of a sweep after its last column, ms.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub readout_ms: f64,
    /// Time from the read-out to the reader, ms.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub transfer_ms: f64,
}

impl LidarConfig {
    /// Specification of the lidar, its noise keyed by `seed`.
    pub fn spec(&self, seed: u64) -> Result<LidarSpec, Faults> {
        let beside = [("beams", "beams_deg"), ("rate_hz", "rate_hz")];
        let mut table = self.params.clone();
        let mut told = Faults::new();
        if table.remove("seed").is_some() {
            told.push((
                "params.seed".into(),
                "unknown key; the noise is keyed by the run's seed and the name".into(),
            ));
        }
        for (k, &[elevation, azimuth]) in self.beams_deg.iter().enumerate() {
            let key = format!("beams_deg[{k}]");
            range(&mut told, &key, elevation, [-90.0, 90.0]);
            range(&mut told, &key, azimuth, [-180.0, 180.0]);
        }
        let mut spec = match overridden(&self.preset.spec(), &table, &beside) {
            Ok(spec) if told.is_empty() => spec,
            spec => return Err([told, spec.err().unwrap_or_default()].concat()),
        };
        if !self.beams_deg.is_empty() {
            let beam = |[elevation, azimuth]: &[f64; 2]| Beam {
                elevation_rad: elevation.to_radians(),
                azimuth_rad: azimuth.to_radians(),
            };
            spec.beams = self.beams_deg.iter().map(beam).collect();
        }
        spec.rate_hz = self.rate_hz.unwrap_or(spec.rate_hz);
        spec.seed = seed;
        spec.check().map_err(|error| vec![lidar_fault(&error)])?;
        Ok(spec)
    }

    /// Position in the ego frame, m.
    pub fn at_m(&self, shape: &Shape) -> [f64; 3] {
        let roof = SensorMount::roof(shape);
        self.at_m.unwrap_or([roof.x_m, roof.y_m, roof.z_m])
    }

    /// Pose in the ego frame.
    pub fn ego_from_lidar(&self, shape: &Shape) -> Transform<Ego, Lidar> {
        let [x, y, z] = self.at_m(shape);
        let [roll, pitch, yaw] = [self.roll_deg, self.pitch_deg, self.yaw_deg].map(f64::to_radians);
        Transform::from_roll_pitch_yaw(Point::new(x, y, z), roll, pitch, yaw)
    }

    /// Times from the end of a sweep, which is its stamp, to the reader.
    pub fn timing(&self) -> SensorTiming {
        let &Self { readout_ms, transfer_ms, .. } = self;
        SensorTiming { exposure_ms: 0.0, readout_ms, transfer_ms, rolling: false }
    }

    pub(crate) fn faults(&self, shape: &Shape, dt_ms: f64) -> Faults {
        let mut told = problems_of_ranges(self);
        match self.spec(0) {
            Ok(spec) if spec.rate_hz * dt_ms > 1000.0 => {
                let message = format!(
                    "expected at most one turn in a step of the world of {dt_ms} ms, found {}",
                    spec.rate_hz
                );
                told.push(("rate_hz".into(), message));
            }
            Ok(_) => {}
            // `rate_hz` is also a parameter.
            Err(faults) => told.extend(faults.into_iter().filter(|(key, _)| key != "rate_hz")),
        }
        let [x_m, y_m, z_m] = self.at_m(shape);
        told.extend(mount_faults(&SensorMount { x_m, y_m, z_m, yaw_rad: self.yaw_deg.to_radians() }, shape));
        told
    }
}

/// Problem of a lidar under its key in the configuration.
fn lidar_fault(error: &ParamError) -> (String, String) {
    let field = error.key.as_ref();
    let here = |text: &str| text.replace("beams[", "beams_deg[");
    let key = match field {
        "rate_hz" => field.to_owned(),
        "beams x columns" => "params.columns".to_owned(),
        _ if field.starts_with("beams") => here(field),
        _ => format!("params.{field}"),
    };
    (key, format!("expected {}, found {}", error.expected, here(&error.value.to_string())))
}

/// A preset with changed parameters. Keys in `beside` are set outside the parameters and refused among them.
fn overridden<T: Serialize + DeserializeOwned>(
    preset: &T,
    params: &toml::Table,
    beside: &[(&str, &str)],
) -> Result<T, Faults> {
    let twice = |(key, own): &&(&str, &str)| {
        params
            .contains_key(*key)
            .then(|| (format!("params.{key}"), format!("expected as `{own}` beside `params`")))
    };
    let told: Faults = beside.iter().filter_map(|pair| twice(&pair)).collect();
    if !told.is_empty() {
        return Err(told);
    }
    swerve_text::overridden(preset, params).map_err(|problems| {
        problems.into_iter().map(|(key, message)| (format!("params.{key}"), message)).collect()
    })
}

fn range(told: &mut Faults, key: &str, value: f64, [low, high]: [f64; 2]) {
    if !(low..=high).contains(&value) {
        told.push((key.to_owned(), format!("expected {low} to {high}, found {}", number(value))));
    }
}

fn mount_faults(mount: &SensorMount, shape: &Shape) -> Faults {
    // The angle is checked as `yaw_deg`.
    let wrong = mount.out_of_range().into_iter().filter(|error| error.key != "yaw_rad").map(problem);
    let mut told: Faults =
        wrong.map(|(axis, message)| ("at_m".to_owned(), format!("{axis}: {message}"))).collect();
    if told.is_empty() && mount.is_inside(shape) {
        let message = "expected a place outside the car's body: it would see nothing else";
        told.push(("at_m".into(), message.into()));
    }
    told
}

#[cfg(test)]
mod tests;
