// Copyright 2026 DAMADICS FD maintainers
// SPDX-License-Identifier: Apache-2.0
// Read a valve and hear its alarm with node-opcua: `node read.mjs URL TOKEN`, JSON on stdout.
import {
  AttributeIds, ClientMonitoredItem, OPCUAClient, UserTokenType, constructEventFilter,
} from "node-opcua-client";

const [url, token] = process.argv.slice(2);
const client = OPCUAClient.create({ endpointMustExist: false, connectionStrategy: { maxRetry: 1 } });
await client.connect(url);
const session = await client.createSession({
  type: UserTokenType.UserName, userName: "reader", password: token,
});
const spaces = await session.readNamespaceArray();
const own = spaces.indexOf("urn:damadics:fd");
const node = (name) => `ns=${own};s=lv101${name}`;
const value = async (nodeId, attributeId = AttributeIds.Value) =>
  (await session.read({ nodeId, attributeId })).value.value;
let named = null; // the server meets its valves a while after it has started
for (let n = 0; !named && n < 100; n++) {
  named = await value(node(""), AttributeIds.BrowseName);
  if (!named) await new Promise((resolve) => setTimeout(resolve, 200));
}
const browse = named.name;
const types = await session.browse({
  nodeId: node(""), referenceTypeId: "HasTypeDefinition", browseDirection: 0,
  includeSubtypes: true, nodeClassMask: 0, resultMask: 63,
});
const type = types.references[0].browseName.name;

const fields = ["Message", "ActiveState.Id", "AckedState.Id", "Severity"];
const subscription = await session.createSubscription2({
  requestedPublishingInterval: 100, requestedMaxKeepAliveCount: 10, requestedLifetimeCount: 100,
  publishingEnabled: true,
});
const item = ClientMonitoredItem.create(
  subscription, { nodeId: "i=2253", attributeId: AttributeIds.EventNotifier },
  { samplingInterval: 0, queueSize: 100, filter: constructEventFilter(fields) },
);
const heard = new Promise((resolve) => {
  item.on("changed", (values) => {
    const [message, active, acknowledged, severity] = values.map((v) => v.value);
    if (active) resolve({ message: message.text, active, acknowledged, severity });
  });
});
await new Promise((resolve) => item.on("initialized", resolve));
console.log("listening");
const event = await heard;
await new Promise((resolve) => setTimeout(resolve, 1500));
const told = {
  browse, type, event,
  health: await value(node(".DeviceHealth")), ratio: await value(node(".Ratio")),
};
console.log(JSON.stringify(told));
await session.close();
await client.disconnect();
