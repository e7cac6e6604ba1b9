//! Settings of the safety chain that differ from those of the device.

use bevy::prelude::*;
use palpate_haptics::SafetySettings;

/// Defines the overrides of the fields of [`SafetySettings`], and what is done with each of them.
macro_rules! overrides {
    ($($(#[$attribute:meta])* $field:ident: $type:ty,)+) => {
        /// Settings of the safety chain that differ from those of the device. A field of `None` keeps the device's value, which follows
        /// from its description ([`DeviceDescription::safety`](palpate_haptics::DeviceDescription::safety)).
        ///
        /// ```
        /// # use bevy::prelude::*;
        /// use bevy_palpate::{SafetyOverrides, prelude::*};
        ///
        /// // At most 2 N; everything else as the device needs it.
        /// let safety = SafetyOverrides { max_force_n: Some(2.0), ..default() };
        /// let settings = ToolSettings { safety, ..default() };
        /// # assert_ne!(settings, ToolSettings::default());
        /// ```
        ///
        /// `SafetyOverrides::from` takes [`SafetySettings`], and overrides all fields.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Reflect)]
        #[reflect(Debug, Default, PartialEq, Clone)]
        pub struct SafetyOverrides {
            $($(#[$attribute])* pub $field: Option<$type>,)+
        }

        impl SafetyOverrides {
            /// Returns the settings of the device with these overrides.
            #[must_use]
            pub fn apply_to(&self, device: SafetySettings) -> SafetySettings {
                SafetySettings { $($field: self.$field.unwrap_or(device.$field),)+ }
            }

            /// Returns these overrides with those fields set in which `after` differs from `before`.
            #[cfg(feature = "panel")]
            pub(crate) fn with_changes(self, before: &SafetySettings, after: &SafetySettings) -> Self {
                Self { $($field: Some(after.$field).filter(|now| *now != before.$field).or(self.$field),)+ }
            }
        }

        impl From<SafetySettings> for SafetyOverrides {
            fn from(settings: SafetySettings) -> Self {
                Self { $($field: Some(settings.$field),)+ }
            }
        }
    };
}

overrides! {
    /// Rendered force below which the start-up ramp begins, N. With `f64::MAX` it begins at once.
    arm_below_n: f64,
    /// Duration of the start-up ramp, s.
    ramp_s: f64,
    /// Age above which a local model is stale, in model periods.
    stale_after_periods: f64,
    /// Consecutive ticks without a reading or write after which the force fades.
    device_timeout_ticks: u64,
    /// Duration of the fade to zero for a stale model, a silent device or a pause, s.
    fade_s: f64,
    /// Speed of the hand above which the accelerating component of the force fades, m/s. With `f64::MAX` the velocity guard is off.
    max_speed_m_per_s: f64,
    /// Maximum damping of the passivity stage, N s/m. With zero the stage only observes.
    passivity_damping_ns_per_m: f64,
    /// Energy given to the hand beyond that received at which the passivity stage starts to damp, J.
    passivity_tolerance_j: f64,
    /// Maximum force, N; the device's own limit also applies.
    max_force_n: f64,
    /// Maximum growth of the force, N/s; the device's own limit also applies.
    max_slew_n_per_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use palpate_haptics::{HapticDevice, Reading, ScriptedDevice};

    #[test]
    fn one_field_keeps_the_others_of_the_device() {
        let device = ScriptedDevice::new(|_, _| Ok(Reading::at(glam::DVec3::ZERO))).describe().safety(1e-3);
        assert_ne!(device, SafetySettings::default());
        assert_eq!(SafetyOverrides::default().apply_to(device), device);
        let one = SafetyOverrides { max_force_n: Some(0.8), ..default() };
        assert_eq!(one.apply_to(device), SafetySettings { max_force_n: 0.8, ..device });
        let all = SafetySettings { ramp_s: 0.1, ..SafetySettings::default() };
        assert_eq!(SafetyOverrides::from(all).apply_to(device), all);
    }

    #[cfg(feature = "panel")]
    #[test]
    fn change_sets_only_its_own_field() {
        let device = SafetySettings::default();
        let before = SafetyOverrides { fade_s: Some(0.3), ..default() };
        let active = before.apply_to(device);
        let after = before.with_changes(&active, &SafetySettings { ramp_s: 0.1, ..active });
        assert_eq!(after, SafetyOverrides { ramp_s: Some(0.1), ..before });
    }
}
