//! Random messages.

use proptest::prelude::*;
use robot_link::mavlink::*;

fn float() -> impl Strategy<Value = f32> {
    prop_oneof![Just(0.0f32), Just(-0.0), Just(f32::MAX), -100.0..100.0f32]
}

/// Any message known here.
pub fn message() -> impl Strategy<Value = Message> {
    let byte = any::<u8>();
    let vector = || [float(), float(), float()];
    prop_oneof![
        (any::<u32>(), any::<[u8; 5]>()).prop_map(|(custom_mode, b)| Message::Heartbeat(Heartbeat {
            custom_mode,
            vehicle_type: b[0],
            autopilot: b[1],
            base_mode: b[2],
            system_status: b[3],
            mavlink_version: b[4]
        })),
        (
            prop::array::uniform3(any::<u32>()),
            prop::array::uniform6(any::<u16>()),
            any::<[u16; 2]>(),
            any::<i16>(),
            any::<i8>()
        )
            .prop_map(|(sensors, errors, [load, voltage_battery], current_battery, battery_remaining)| {
                Message::SysStatus(SysStatus {
                    sensors,
                    load,
                    voltage_battery,
                    current_battery,
                    errors,
                    battery_remaining,
                })
            }),
        (any::<[i32; 2]>(), prop::array::uniform10(any::<u16>()), any::<[i16; 2]>(), any::<[u8; 3]>(), any::<i8>())
            .prop_map(
                |(
                    [current_consumed, energy_consumed],
                    voltages,
                    [temperature, current_battery],
                    b,
                    battery_remaining,
                )| {
                    Message::BatteryStatus(BatteryStatus {
                        current_consumed,
                        energy_consumed,
                        temperature,
                        voltages,
                        current_battery,
                        id: b[0],
                        battery_function: b[1],
                        battery_type: b[2],
                        battery_remaining,
                    })
                }
            ),
        (prop::array::uniform7(float()), any::<u16>(), any::<[u8; 3]>()).prop_map(|(params, command, b)| {
            Message::CommandLong(CommandLong {
                params,
                command,
                target_system: b[0],
                target_component: b[1],
                confirmation: b[2],
            })
        }),
        (any::<u16>(), any::<i32>(), any::<[u8; 4]>()).prop_map(|(command, result_param2, b)| Message::CommandAck(
            CommandAck {
                command,
                result_param2,
                result: b[0],
                progress: b[1],
                target_system: b[2],
                target_component: b[3]
            }
        )),
        (any::<u32>(), vector(), vector(), vector(), float(), float(), any::<u16>(), any::<[u8; 3]>()).prop_map(
            |(time_boot_ms, position, velocity, acceleration, yaw, yaw_rate, type_mask, b)| {
                Message::SetPositionTargetLocalNed(SetPositionTargetLocalNed {
                    time_boot_ms,
                    position,
                    velocity,
                    acceleration,
                    yaw,
                    yaw_rate,
                    type_mask,
                    target_system: b[0],
                    target_component: b[1],
                    coordinate_frame: b[2],
                })
            }
        ),
        (any::<u32>(), prop::array::uniform4(float()), vector(), prop::array::uniform4(float())).prop_map(
            |(time_boot_ms, attitude, angular_velocity, display_offset)| {
                Message::AttitudeQuaternion(AttitudeQuaternion {
                    time_boot_ms,
                    attitude,
                    angular_velocity,
                    display_offset,
                })
            }
        ),
        (any::<u32>(), vector(), vector()).prop_map(|(time_boot_ms, position, velocity)| {
            Message::LocalPositionNed(LocalPositionNed { time_boot_ms, position, velocity })
        }),
        (any::<u8>(), "[ -~]{0,50}", any::<u16>(), any::<u8>()).prop_map(|(severity, words, id, chunk)| {
            let mut text = [0; 50];
            text[..words.len()].copy_from_slice(words.as_bytes());
            Message::StatusText(StatusText { severity, text, id, chunk })
        }),
        (any::<i64>(), prop_oneof![Just(0), any::<i64>()])
            .prop_map(|(tc1, ts1)| Message::Timesync(Timesync { tc1, ts1 })),
        (
            any::<u64>(),
            prop::array::uniform4(float()),
            prop::array::uniform21(float()),
            any::<[u8; 4]>(),
            any::<i8>(),
            byte
        )
            .prop_map(|(time_usec, attitude, pose_covariance, b, quality, x)| {
                let v = [f32::from(x), 1.0, attitude[0]];
                Message::Odometry(Box::new(Odometry {
                    time_usec,
                    position: v,
                    attitude,
                    velocity: v,
                    angular_velocity: v,
                    pose_covariance,
                    velocity_covariance: pose_covariance,
                    frame_id: b[0],
                    child_frame_id: b[1],
                    reset_counter: b[2],
                    estimator_type: b[3],
                    quality,
                }))
            }),
    ]
}
