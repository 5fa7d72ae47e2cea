//! Bytes made by other implementations: pymavlink 2.4.50 (system 245, component 191) and cyclonedds 11.0.1. The newer ones of
//! pymavlink come from `tests/data/pymavlink_peer.py golden`.

use robot_link::mavlink::signing::{Signer, SigningKey, Verifier};
use robot_link::mavlink::{
    AttitudeQuaternion, BatteryStatus, CommandAck, CommandLong, FrameReader, FrameWriter, Heartbeat, LocalPositionNed,
    Message, Odometry, Received, SetPositionTargetLocalNed, StatusText, SysStatus, Timesync,
};
use robot_link::unitree::{Call, ImuState, Request, Response, SportModeState};

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).expect("hex")).collect()
}

/// Our frame equals theirs, and theirs reads as our message.
fn check_frame(sequence: u8, message: Message, hex: &str) {
    let mut writer = FrameWriter { sequence, ..FrameWriter::new(245, 191) };
    assert_eq!(writer.write(&message), bytes(hex), "{message:?}");
    let mut reader = FrameReader::new();
    let received = reader.read(&bytes(hex));
    assert_eq!(received.len(), 1);
    // Compared as text: a covariance may begin with NaN.
    let expected = Received { system_id: 245, component_id: 191, sequence, message };
    assert_eq!(format!("{:?}", received[0]), format!("{expected:?}"));
}

#[test]
fn heartbeats() {
    let ours =
        Heartbeat { vehicle_type: 18, autopilot: 8, system_status: 4, mavlink_version: 3, ..Heartbeat::default() };
    assert_eq!(ours, robot_link::mavlink::offboard::heartbeat());
    check_frame(7, Message::Heartbeat(ours), "fd09000007f5bf000000000000001208000403ae17");
    let armed = Heartbeat {
        custom_mode: 6 << 16,
        vehicle_type: 2,
        autopilot: 12,
        base_mode: 0x9d,
        system_status: 4,
        mavlink_version: 3,
    };
    check_frame(255, Message::Heartbeat(armed), "fd090000fff5bf00000000000600020c9d0403a508");
}

#[test]
fn set_points() {
    let full = SetPositionTargetLocalNed {
        time_boot_ms: 123_456,
        position: [1.5, -2.25, -3.0],
        velocity: [0.5, 0.25, -0.125],
        acceleration: [0.1, -0.2, 0.3],
        yaw: 0.75,
        yaw_rate: 0.0,
        type_mask: 0x800,
        target_system: 1,
        target_component: 1,
        coordinate_frame: 1,
    };
    check_frame(
        1,
        Message::SetPositionTargetLocalNed(full),
        "fd35000001f5bf54000040e201000000c03f000010c0000040c00000003f0000803e000000becdcccc3dcdcc4cbe9a99993e0000403f0000000000080101019c39",
    );
    let velocity = SetPositionTargetLocalNed {
        time_boot_ms: 5,
        velocity: [0.5, 0.0, 0.0],
        yaw_rate: -0.5,
        type_mask: 1479,
        target_system: 1,
        coordinate_frame: 1,
        ..SetPositionTargetLocalNed::default()
    };
    check_frame(
        2,
        Message::SetPositionTargetLocalNed(velocity),
        "fd35000002f5bf540000050000000000000000000000000000000000003f000000000000000000000000000000000000000000000000000000bfc70501000134e5",
    );
}

#[test]
fn commands_and_answers() {
    use robot_link::mavlink::offboard::{Mode, arm, set_mode};
    let offboard = CommandLong {
        params: [1.0, 6.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        command: 176,
        target_system: 1,
        target_component: 1,
        confirmation: 2,
    };
    assert_eq!(offboard, set_mode((1, 1), Mode::Offboard, 2));
    check_frame(
        3,
        Message::CommandLong(offboard),
        "fd21000003f5bf4c00000000803f0000c0400000000000000000000000000000000000000000b0000101025f04",
    );
    check_frame(
        4,
        Message::CommandLong(arm((1, 1), true, 0)),
        "fd20000004f5bf4c00000000803f00000000000000000000000000000000000000000000000090010101fcf4",
    );
    let answer = CommandAck { command: 400, result: 4, ..CommandAck::default() };
    check_frame(5, Message::CommandAck(answer), "fd03000005f5bf4d0000900104442b");
    let extended = CommandAck {
        command: 176,
        result: 5,
        progress: 42,
        result_param2: -7,
        target_system: 245,
        target_component: 191,
    };
    check_frame(6, Message::CommandAck(extended), "fd0a000006f5bf4d0000b000052af9fffffff5bf9d27");
}

#[test]
fn clocks() {
    let request = Timesync { tc1: 0, ts1: 1_234_567_890_123_456_789 };
    check_frame(8, Message::Timesync(request), "fd10000008f5bf6f000000000000000000001581e97df41022117681");
    check_frame(9, Message::Timesync(Timesync { tc1: -5, ts1: 77 }), "fd09000009f5bf6f0000fbffffffffffffff4d757c");
}

#[test]
fn odometry() {
    let mut velocity_covariance = [0.0; 21];
    velocity_covariance[0] = f32::NAN;
    let odometry = Odometry {
        time_usec: 987_654_321,
        position: [1.0, 2.0, -3.0],
        attitude: [0.5, -0.5, 0.5, -0.5],
        velocity: [0.1, 0.2, 0.3],
        angular_velocity: [-0.01, 0.02, -0.03],
        pose_covariance: std::array::from_fn(|i| (0.01 * (i as f64 + 1.0)) as f32),
        velocity_covariance,
        frame_id: 20,
        child_frame_id: 12,
        reset_counter: 3,
        estimator_type: 2,
        quality: 95,
    };
    check_frame(
        10,
        Message::Odometry(Box::new(odometry)),
        concat!(
            "fde900000af5bf4b0100b168de3a000000000000803f00000040000040c00000003f000000bf0000003f000000bfcdcccc3dcdcc4c3e9a99993e0ad723bc0ad7",
            "a33c8fc2f5bc0ad7233c0ad7a33c8fc2f53c0ad7233dcdcc4c3d8fc2753d295c8f3d0ad7a33dec51b83dcdcccc3dae47e13d8fc2f53db81e053e295c0f3e9a99",
            "193e0ad7233e7b142e3eec51383e5c8f423ecdcc4c3e3d0a573e0000c07f00000000000000000000000000000000000000000000000000000000000000000000",
            "00000000000000000000000000000000000000000000000000000000000000000000000000000000000000000000140c03025fd5fa"
        ),
    );
}

#[test]
fn telemetry_and_texts() {
    let attitude = AttitudeQuaternion {
        time_boot_ms: 4321,
        attitude: [0.5, -0.5, 0.5, 0.5],
        angular_velocity: [0.125, -0.25, 1.5],
        display_offset: [0.0; 4],
    };
    check_frame(
        11,
        Message::AttitudeQuaternion(attitude),
        "fd2000000bf5bf1f0000e11000000000003f000000bf0000003f0000003f0000003e000080be0000c03f6df4",
    );
    let position = LocalPositionNed { time_boot_ms: 4322, position: [1.5, -2.5, -3.25], velocity: [0.5, 0.25, -0.125] };
    check_frame(
        12,
        Message::LocalPositionNed(position),
        "fd1c00000cf5bf200000e21000000000c03f000020c0000050c00000003f0000803e000000be0a7d",
    );
    let mut text = [0; 50];
    text[..26].copy_from_slice(b"Arming denied: no estimate");
    check_frame(
        13,
        Message::StatusText(StatusText { severity: 4, text, id: 0, chunk: 0 }),
        "fd1b00000df5bffd00000441726d696e672064656e6965643a206e6f20657374696d6174651cb2",
    );
}

#[test]
fn batteries() {
    let vehicle = SysStatus {
        sensors: [7, 3, 1],
        load: 512,
        voltage_battery: 15_250,
        current_battery: 1234,
        errors: [1, 2, 3, 4, 5, 6],
        battery_remaining: 63,
    };
    check_frame(
        18,
        Message::SysStatus(vehicle),
        "fd1f000012f5bf0100000700000003000000010000000002923bd2040100020003000400050006003f5f52",
    );
    let mut voltages = [u16::MAX; 10];
    voltages[..2].copy_from_slice(&[3810, 3805]);
    let battery = BatteryStatus {
        current_consumed: 310,
        energy_consumed: -1,
        temperature: 2512,
        voltages,
        current_battery: 1234,
        id: 1,
        battery_function: 1,
        battery_type: 3,
        battery_remaining: 63,
    };
    check_frame(
        19,
        Message::BatteryStatus(battery),
        "fd24000013f5bf93000036010000ffffffffd009e20edd0effffffffffffffffffffffffffffffffd2040101033fb2fb",
    );
}

#[test]
fn wishes_and_landing() {
    use robot_link::mavlink::offboard::{land, wish_for_message};
    check_frame(
        14,
        Message::CommandLong(land((1, 1))),
        "fd2000000ef5bf4c00000000000000000000000000000000c07f0000c07f0000c07f0000000015000101bccc",
    );
    check_frame(
        15,
        Message::CommandLong(wish_for_message((1, 1), 32, 20_000.0)),
        "fd2000000ff5bf4c00000000004200409c460000000000000000000000000000000000000000ff0101010607",
    );
}

/// pymavlink with the key 00 01 .. 1f, link 3.
#[test]
fn signed_frames() {
    let key = SigningKey::new(std::array::from_fn(|i| i as u8));
    let mut writer = FrameWriter { sequence: 16, ..FrameWriter::new(245, 191) };
    let start = 37_100_000_000_000;
    let mut signer = Signer::new(key.clone(), 3, start - 1);
    let messages = [
        Message::Heartbeat(robot_link::mavlink::offboard::heartbeat()),
        Message::Timesync(Timesync { tc1: 0, ts1: 5 }),
    ];
    let golden = [
        "fd09010010f5bf00000000000000120800040382fc0300385204be211d388bd0bdbb",
        "fd09010011f5bf6f0000000000000000000005bea60301385204be21bb68665b4c9a",
    ];
    let mut reader = FrameReader::demanding(Verifier::new(key, start));
    for (message, hex) in messages.iter().zip(golden) {
        assert_eq!(writer.write_signed(message, &mut signer, start), Some(bytes(hex)), "{message:?}");
        let received: Vec<Message> = reader.read(&bytes(hex)).into_iter().map(|received| received.message).collect();
        assert_eq!(received, std::slice::from_ref(message));
        // The same frame once more is a replay.
        assert!(reader.read(&bytes(hex)).is_empty());
    }
    assert_eq!((reader.statistics.messages, reader.statistics.replayed), (2, 2));
}

#[test]
fn unitree_requests() {
    let call = Call::Move { forward_mps: 0.5, left_mps: 0.0, yaw_rate_radps: 0.0 };
    let request = call.request(1).expect("finite");
    let golden = bytes(
        "000100000100000000000000f00300000000000000000000000000000000000001000000160000007b2278223a302e352c2279223a302c227a223a307d00000000000000",
    );
    assert_eq!(golden.len(), 68);
    assert_eq!(request.to_cdr(), golden);
    assert_eq!(Request::from_cdr(&golden), Ok(request));
    let other =
        Request { id: -2, api_id: 1004, lease_id: 9, priority: -1, binary: vec![1, 2, 3], ..Request::default() };
    let golden =
        bytes("00010000feffffffffffffffec030000000000000900000000000000ffffffff00000000010000000000000003000000010203");
    assert_eq!(other.to_cdr(), golden);
    assert_eq!(Request::from_cdr(&golden), Ok(other));
}

#[test]
fn unitree_responses() {
    let response = Response { id: 77, api_id: 1008, code: -3204, data: "ok!".into(), binary: vec![255] };
    let golden = bytes("000100004d00000000000000f0030000000000007cf3ffff040000006f6b210001000000ff");
    assert_eq!(response.to_cdr(), golden);
    assert_eq!(Response::from_cdr(&golden), Ok(response));
}

#[test]
fn unitree_states_in_both_layouts() {
    let state = SportModeState {
        stamp_s: -3,
        stamp_ns: 999_999_999,
        error_code: 42,
        imu: ImuState {
            quaternion: [1.0, 0.0, -0.5, 0.25],
            gyroscope: [0.5, 1.0, 1.5],
            accelerometer: [0.0, 0.0, 9.75],
            rpy: [0.125, 0.25, 0.375],
            temperature: 33,
        },
        mode: 3,
        progress: 0.5,
        gait_type: 1,
        foot_raise_height_m: 0.0625,
        position: [1.0, 2.0, 0.3125],
        body_height_m: 0.28125,
        velocity: [0.5, -0.25, 0.0],
        yaw_speed_radps: -0.75,
        range_obstacle: [1.0, 2.0, 3.0, 4.0],
        foot_force: [10, -20, 30, -40],
        foot_position_body: std::array::from_fn(|i| i as f32 / 4.0),
        foot_speed_body: std::array::from_fn(|i| -(i as f32) / 8.0),
    };
    let mut golden = bytes(concat!(
        "00010000fdffffffffc99a3b2a0000000000803f00000000000000bf0000803e0000003f0000803f0000c03f000000000000000000001c410000003e0000803e",
        "0000c03e210300000000003f010000000000803d0000803f000000400000a03e0000903e0000003f000080be00000000000040bf0000803f0000004000004040",
        "000080400a00ecff1e00d8ff000000000000803e0000003f0000403f0000803f0000a03f0000c03f0000e03f0000004000001040000020400000304000000080",
        "000000be000080be0000c0be000000bf000020bf000040bf000060bf000080bf000090bf0000a0bf0000b0bf"
    ));
    assert_eq!(state.to_cdr(), golden);
    assert_eq!(SportModeState::from_cdr(&golden), Ok(state));
    // The SDK appends ten path points of seven floats.
    golden.extend([0x41; 280]);
    assert_eq!(SportModeState::from_cdr(&golden), Ok(state));
}
