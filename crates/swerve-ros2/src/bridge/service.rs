//! Autoware's control mode service, the only service of a vehicle.

use std::sync::PoisonError;
use std::time::Duration;

use ros2_client::dds::{Client, Node, Server, ServiceMapping};
use ros2_client::qos::{History, QosProfile, Reliability, WhenFull};
use ros2_client::{Message, Name, ServiceTypeName};

use super::receive::Shared;
use super::{BridgeError, PUBLISH_WAIT, ServiceError, ServiceSide};
use crate::mapping::ServiceMap;
use crate::msg::autoware_vehicle_msgs::{ControlModeCommandRequest, ControlModeCommandResponse};
use crate::msg::builtin_interfaces::Time;

/// Polling period of a client that waits for an answer.
const LOOK_EVERY: Duration = Duration::from_millis(5);

impl Message for ControlModeCommandRequest {}
impl Message for ControlModeCommandResponse {}

pub(super) struct ControlModeClient(Client<ControlModeCommandRequest, ControlModeCommandResponse>);
pub(super) struct ControlModeServer(Server<ControlModeCommandRequest, ControlModeCommandResponse>);

pub(super) fn open(
    node: &mut Node,
    map: ServiceMap,
    service: Option<&(ServiceSide, String)>,
) -> Result<(Option<ControlModeClient>, Option<ControlModeServer>), BridgeError> {
    let Some((side, topic)) = service else { return Ok((None, None)) };
    let name = Name::parse(topic)
        .map_err(|e| BridgeError::Name { name: topic.clone(), reason: format!("{e:?}") })?;
    let type_name = ServiceTypeName::new("autoware_vehicle_msgs", "ControlModeCommand");
    let mapping = match map {
        ServiceMap::Enhanced => ServiceMapping::Enhanced,
        ServiceMap::Cyclone => ServiceMapping::Cyclone,
        ServiceMap::Basic => ServiceMapping::Basic,
    };
    let qos = QosProfile::subscription_default()
        .reliability(Reliability::Reliable { when_full: WhenFull::Wait(PUBLISH_WAIT) })
        .history(History::KeepLast { depth: 10 });
    let failed =
        |e: ros2_client::CreateError| BridgeError::Transport { at: topic.clone(), reason: e.to_string() };
    Ok(match side {
        ServiceSide::Client => {
            let client = node.create_client(mapping, &name, &type_name, qos.clone(), qos).map_err(failed)?;
            (Some(ControlModeClient(client)), None)
        }
        ServiceSide::Server => {
            let server = node.create_server(mapping, &name, &type_name, qos.clone(), qos).map_err(failed)?;
            (None, Some(ControlModeServer(server)))
        }
    })
}

impl ControlModeClient {
    pub(super) fn call(&self, mode: u8, timeout: Duration, shared: &Shared) -> Result<bool, ServiceError> {
        let request = ControlModeCommandRequest { stamp: Time::default(), mode };
        let id = self.0.send_request(request).map_err(|e| ServiceError::Transport(e.to_string()))?;
        let looks = timeout.as_micros().div_ceil(LOOK_EVERY.as_micros());
        for _ in 0..looks {
            // Skips answers to earlier requests and unreadable ones.
            while let Ok(Some((answered, response))) = self.0.receive_response() {
                if answered == id {
                    return Ok(response.success);
                }
            }
            let state = shared.lock();
            // There is no early notification: this is a sleep.
            drop(
                shared
                    .news
                    .wait_timeout_while(state, LOOK_EVERY, |_| true)
                    .unwrap_or_else(PoisonError::into_inner),
            );
        }
        Err(ServiceError::NoAnswer)
    }
}

impl ControlModeServer {
    pub(super) fn serve(&self, mut take: impl FnMut(u8) -> bool) -> usize {
        let mut served = 0;
        while let Ok(Some((id, request))) = self.0.receive_request() {
            let success = take(request.mode);
            served += usize::from(self.0.send_response(id, ControlModeCommandResponse { success }).is_ok());
        }
        served
    }
}
