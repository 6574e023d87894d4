// Sends back what it receives with eProsima Fast DDS: echo DOMAIN QOS
// With `service` for QOS it answers requests instead.
//
// As echo.py. Payloads are sent back byte by byte, but for the three messages below, which Fast CDR decodes field by
// field and encodes again: a command, a report with a header, and a point cloud.
#include <fastcdr/Cdr.h>
#include <fastcdr/FastBuffer.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <iostream>
#include <memory>
#include <string>
#include <unistd.h>
#include <vector>

using namespace eprosima::fastdds::dds;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;
using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

using Payload = std::vector<char>;

// Copies fields from one stream to another: what is decoded wrongly is encoded wrongly.
struct Again {
  Cdr &in, &out;
  template <typename T> void field(int n = 1) {
    for (int i = 0; i < n; i++) {
      T value{};
      in >> value;
      out << value;
    }
  }
  uint32_t length() {
    uint32_t n = 0;
    in >> n;
    out << n;
    return n;
  }
  void text() { field<std::string>(); }
  void stamp() {
    field<int32_t>();
    field<uint32_t>();
  }
  void header() {
    stamp();
    text();
  }
  void bytes() { field<std::vector<uint8_t>>(); }
};

static void control(Again a) {
  a.stamp(), a.stamp();
  a.stamp(), a.stamp(), a.field<float>(2), a.field<bool>();
  a.stamp(), a.stamp(), a.field<float>(3), a.field<bool>(2);
}

static void velocity(Again a) { a.header(), a.field<float>(3); }

static void cloud(Again a) {
  a.header(), a.field<uint32_t>(2);
  for (uint32_t n = a.length(); n > 0; n--) a.text(), a.field<uint32_t>(), a.field<uint8_t>(), a.field<uint32_t>();
  a.field<bool>(), a.field<uint32_t>(2), a.bytes(), a.field<bool>();
}

static Payload encode_again(const Payload &payload, void (*fields)(Again)) {
  FastBuffer from(const_cast<char *>(payload.data()), payload.size());
  Payload room(payload.size() + 64);
  FastBuffer to(room.data(), room.size());
  Cdr in(from, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR), out(to, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR);
  in.read_encapsulation();
  out.serialize_encapsulation();
  fields(Again{in, out});
  room.resize(out.getSerializedDataLength());
  return room;
}

class Bytes : public TopicDataType {
public:
  explicit Bytes(const std::string &name) {
    setName(name.c_str());
    m_typeSize = 4 * 1024 * 1024;
    m_isGetKeyDefined = false;
  }
  bool serialize(void *data, SerializedPayload_t *payload) override {
    const Payload &bytes = *static_cast<Payload *>(data);
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(SerializedPayload_t *payload, void *data) override {
    const char *bytes = reinterpret_cast<const char *>(payload->data);
    static_cast<Payload *>(data)->assign(bytes, bytes + payload->length);
    return true;
  }
  std::function<uint32_t()> getSerializedSizeProvider(void *data) override {
    return [data] { return static_cast<uint32_t>(static_cast<Payload *>(data)->size()); };
  }
  void *createData() override { return new Payload; }
  void deleteData(void *data) override { delete static_cast<Payload *>(data); }
  bool getKey(void *, InstanceHandle_t *, bool) override { return false; }
};

struct Echo : DataReaderListener {
  DataWriter *writer = nullptr;
  void (*fields)(Again) = nullptr;
  void on_data_available(DataReader *reader) override {
    Payload payload;
    SampleInfo info;
    while (reader->take_next_sample(&payload, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      Payload back = fields ? encode_again(payload, fields) : payload;
      writer->write(&back);
    }
  }
};

// Answers Autoware's requests for a control mode as a node on rmw_fastrtps does: a reply says in its parameters which
// request it is for. Takes the modes 1 (autonomous) and 4 (manual).
struct Service : DataReaderListener {
  DataWriter *writer = nullptr;
  void on_data_available(DataReader *reader) override {
    Payload payload;
    SampleInfo info;
    while (reader->take_next_sample(&payload, &info) == ReturnCode_t::RETCODE_OK) {
      // Header, seconds, nanoseconds, mode.
      if (!info.valid_data || payload.size() < 13) continue;
      Payload reply{0, 1, 0, 0, payload[12] == 1 || payload[12] == 4, 0, 0, 0};
      auto request = info.sample_identity;
      auto asker = info.related_sample_identity.writer_guid();
      if (asker != eprosima::fastrtps::rtps::GUID_t::unknown()) request.writer_guid() = asker;
      eprosima::fastrtps::rtps::WriteParams params;
      params.related_sample_identity(request);
      writer->write(&reply, params);
    }
  }
};

template <typename Q> static Q policy(Q qos, const std::string &name) {
  bool best_effort = name == "best_effort", latched = name == "latched";
  qos.reliability().kind = best_effort ? BEST_EFFORT_RELIABILITY_QOS : RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = latched ? 1 : 100;
  // Room is made as it is needed, not for the largest message at once.
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::DYNAMIC_RESERVE_MEMORY_MODE;
  return qos;
}

// Payloads under a true type name that are none: random bytes of random length behind a true header.
static void noise(DataWriter &writer, int count) {
  static uint64_t state = 0x9e3779b97f4a7c15;
  auto random = [] {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    return static_cast<uint32_t>(state >> 32);
  };
  while (count-- > 0) {
    Payload payload{0, 1, 0, 0};
    for (uint32_t n = random() % 600; n > 0; n--) payload.push_back(static_cast<char>(random() % 3 ? 0 : random()));
    writer.write(&payload);
    usleep(100);
  }
}

int main(int argc, char **argv) {
  if (argc != 3) return 2;
  DomainParticipantQos participant_qos;
  participant_qos.transport().use_builtin_transports = false;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.push_back("127.0.0.1");
  udp->receiveBufferSize = udp->sendBufferSize = 4 * 1024 * 1024;
  participant_qos.transport().user_transports.push_back(udp);
  participant_qos.transport().listen_socket_buffer_size = 4 * 1024 * 1024;
  eprosima::fastrtps::rtps::Locator_t here;
  here.kind = LOCATOR_KIND_UDPv4;
  eprosima::fastrtps::rtps::IPLocator::setIPv4(here, "127.0.0.1");
  // Where participants of this domain listen for others, by DDS's port formula.
  for (int id = 0; id < 10; id++) {
    here.port = 7400 + 250 * std::atoi(argv[1]) + 10 + 2 * id;
    participant_qos.wire_protocol().builtin.initialPeersList.push_back(here);
  }
  auto *participant = DomainParticipantFactory::get_instance()->create_participant(std::atoi(argv[1]), participant_qos);
  if (!participant) return 1;
  auto *publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
  auto *subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  std::vector<std::unique_ptr<Echo>> echoes;
  std::string line;
  Service service;
  if (std::string(argv[2]) == "service") {
    std::string base = "autoware_vehicle_msgs::srv::dds_::ControlModeCommand_";
    TypeSupport(new Bytes(base + "Request_")).register_type(participant);
    TypeSupport(new Bytes(base + "Response_")).register_type(participant);
    std::string name = "/control/control_mode_request";
    auto *requests = participant->create_topic("rq" + name + "Request", base + "Request_", TOPIC_QOS_DEFAULT);
    auto *replies = participant->create_topic("rr" + name + "Reply", base + "Response_", TOPIC_QOS_DEFAULT);
    service.writer = publisher->create_datawriter(replies, policy(DATAWRITER_QOS_DEFAULT, "reliable"));
    if (!service.writer || !subscriber->create_datareader(requests, policy(DATAREADER_QOS_DEFAULT, "reliable"), &service))
      return 1;
  }
  while (std::getline(std::cin, line) && !line.empty()) {
    auto slash = line.find('/');
    std::string type_name = line.substr(0, slash) + "::msg::dds_::" + line.substr(slash + 1) + "_";
    TypeSupport(new Bytes(type_name)).register_type(participant);
    auto *in = participant->create_topic("rt/echo/in/" + line, type_name, TOPIC_QOS_DEFAULT);
    auto *out = participant->create_topic("rt/echo/out/" + line, type_name, TOPIC_QOS_DEFAULT);
    auto echo = std::make_unique<Echo>();
    echo->writer = publisher->create_datawriter(out, policy(DATAWRITER_QOS_DEFAULT, argv[2]));
    if (line == "autoware_control_msgs/Control") echo->fields = control;
    if (line == "autoware_vehicle_msgs/VelocityReport") echo->fields = velocity;
    if (line == "sensor_msgs/PointCloud2") echo->fields = cloud;
    if (!echo->writer || !subscriber->create_datareader(in, policy(DATAREADER_QOS_DEFAULT, argv[2]), echo.get())) {
      std::fprintf(stderr, "no endpoints for %s\n", line.c_str());
      return 1;
    }
    echoes.push_back(std::move(echo));
  }
  std::printf("ready\n");
  std::fflush(stdout);
  // The listeners do the rest, until nobody is interested any more. Each further line is a wish for noise.
  while (std::getline(std::cin, line))
    for (auto &echo : echoes) noise(*echo->writer, 200);
  _exit(0);
}
