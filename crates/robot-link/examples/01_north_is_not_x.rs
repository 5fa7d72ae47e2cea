//! The same set-point through the wire, right and wrong.
//!
//! We want a drone to fly to the east with its nose to the north. The project says so in ENU, PX4 listens in NED. Forgetting the change of
//! axes flies it into the ground to the north; we look at the bytes of both and let damage happen on the way.

use nalgebra::Vector3;
use robot_link::frames::enu_from_ned;
use robot_link::mavlink::offboard::{OffboardError, SetPoint, position_target};
use robot_link::mavlink::{FrameReader, FrameWriter, Message};
use robot_link::unitree::{Call, Request};

fn main() -> Result<(), OffboardError> {
    // 1. Three metres east, two up, nose north.
    let wanted = Vector3::new(3.0, 0.0, 2.0);
    let set_point =
        SetPoint { position_in_world: Some(wanted), yaw_rad: Some(std::f64::consts::FRAC_PI_2), ..SetPoint::default() };
    let target = position_target(1000, (1, 1), &set_point)?;
    println!(
        "1. ENU {:?} becomes north {} east {} down {}, yaw {:.2}",
        wanted.as_slice(),
        target.position[0],
        target.position[1],
        target.position[2],
        target.yaw
    );

    // 2. Without the change of axes PX4 would understand:
    let misread = enu_from_ned(&wanted);
    println!(
        "2. unchanged numbers would mean: {} m east, {} m north, {} m up: underground",
        misread.x, misread.y, misread.z
    );

    // 3. On the wire.
    let frame = FrameWriter::new(245, 191).write(&Message::SetPositionTargetLocalNed(target));
    println!("3. {} bytes: {}", frame.len(), hex(&frame));

    // 4. A stream with noise before, a damaged copy, and a good one.
    let mut damaged = frame.clone();
    damaged[20] ^= 1;
    let stream: Vec<u8> = [&[0xFD, 1, 2][..], &damaged, &frame].concat();
    let mut reader = FrameReader::new();
    let received = reader.read(&stream);
    println!("4. {} message found, {:?}", received.len(), reader.statistics);

    // 5. The walking robot hears the same project in JSON inside CDR.
    let request =
        Call::Move { forward_mps: 0.5, left_mps: 0.0, yaw_rate_radps: 0.0 }.request(1).expect("finite speeds");
    let payload = request.to_cdr();
    println!("5. Move is {} bytes: {}", payload.len(), request.parameter);

    assert_eq!(target.position, [0.0, 3.0, -2.0]);
    assert!(misread.z < 0.0);
    assert_eq!(received.len(), 1);
    assert_eq!(received[0].message, Message::SetPositionTargetLocalNed(target));
    assert_eq!(Request::from_cdr(&payload), Ok(request));
    Ok(())
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
