//! Controllers that a configuration can name: built-in ones, and those of other crates.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_control::{Controller, Following, Input, Law, LawController, Output, Params, Pedals};
use swerve_core::ParamError;
use swerve_text::{KeyProblem, overridden};
use swerve_vehicle::{VehicleParams, pedals_for_accel};

use crate::named::{NoKeys, Of};
use crate::problems::outside;

/// Vehicle and settings of `[control]` for a controller.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct ControllerSetup<'a> {
    /// The vehicle.
    pub vehicle: &'a VehicleParams,
    /// `control.following`, or the planning preset's.
    pub following: Following,
}

/// A controller that `control.controller` can name.
///
/// [`Registry::with_controller`](crate::Registry::with_controller) adds one. It then follows plans in drives, studies and
/// behind the safety gate, as built-in controllers do.
pub trait NamedController: Controller + Sized + 'static {
    /// Name in `control.controller`.
    const NAME: &'static str;

    /// True if it outputs accelerations, which a vehicle of `swerve live` requires; false for pedals only.
    const ACCELERATES: bool = true;

    /// Parameters: the keys of `control.params`.
    type Params: Serialize + DeserializeOwned;

    /// Default parameters.
    fn defaults(of: ControllerSetup<'_>) -> Self::Params;

    /// Creates the controller.
    ///
    /// # Errors
    /// A parameter out of its range.
    fn with_params(params: Self::Params, of: ControllerSetup<'_>) -> Result<Self, ParamError>;
}

/// A controller's type, erased.
pub(crate) trait AnyController: Send + Sync {
    fn accelerates(&self) -> bool;

    /// The controller, from parameters that differ from the defaults.
    fn build(
        &self,
        of: ControllerSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn Controller>, Vec<KeyProblem>>;
}

impl<C: NamedController> AnyController for Of<C> {
    fn accelerates(&self) -> bool {
        C::ACCELERATES
    }

    fn build(
        &self,
        of: ControllerSetup<'_>,
        params: &toml::Table,
    ) -> Result<Box<dyn Controller>, Vec<KeyProblem>> {
        let params = overridden(&C::defaults(of), params)?;
        Ok(Box::new(C::with_params(params, of).map_err(outside)?))
    }
}

/// A built-in controller with the parameters of its law.
pub(crate) struct ByLaw<const LAW: usize>(LawController);

pub(crate) type Pid = ByLaw<{ Law::Pid as usize }>;
pub(crate) type PurePursuit = ByLaw<{ Law::PurePursuit as usize }>;
pub(crate) type Stanley = ByLaw<{ Law::Stanley as usize }>;
pub(crate) type Mpc = ByLaw<{ Law::Mpc as usize }>;

impl<const LAW: usize> ByLaw<LAW> {
    const OF: (&'static str, Law) =
        [("pid", Law::Pid), ("pure_pursuit", Law::PurePursuit), ("stanley", Law::Stanley), ("mpc", Law::Mpc)]
            [LAW];
}

impl<const LAW: usize> Controller for ByLaw<LAW> {
    fn step(&mut self, input: &Input<'_>) -> Output {
        self.0.step(input)
    }
}

impl<const LAW: usize> NamedController for ByLaw<LAW> {
    const NAME: &'static str = Self::OF.0;
    const ACCELERATES: bool = !matches!(Self::OF.1, Law::Pid);
    type Params = NoKeys;

    fn defaults(_: ControllerSetup<'_>) -> NoKeys {
        NoKeys {}
    }

    fn with_params(_: NoKeys, of: ControllerSetup<'_>) -> Result<Self, ParamError> {
        let params = Params { law: Self::OF.1, following: of.following, ..Params::default() };
        Ok(Self(controller(of.vehicle, params)))
    }
}

/// A controller with the pedal map of `vehicle`.
pub fn controller(vehicle: &VehicleParams, params: Params) -> LawController {
    let of = vehicle.clone();
    let pedals = move |accel_mps2: f64, speed_mps: f64| {
        let pedals = pedals_for_accel(&of, speed_mps, accel_mps2);
        Pedals { throttle: pedals.throttle, brake: pedals.brake }
    };
    LawController::new(params, vehicle.shape, vehicle.limits, Box::new(pedals))
}
