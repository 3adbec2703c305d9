#include "reproduce/tool_picture.hpp"

#include <array>
#include <utility>

#include "tool/tool_proxies.hpp"

namespace haptic::sim::reproduce {
namespace {

constexpr std::array kSkinColour{0.87, 0.63, 0.50};
constexpr double kMarkSize = 0.25;  // of a proxy's radius: radius of the mark at its contact

}  // namespace

void capture(const ToolProxies& tool, ToolMoment& moment) {
    moment.skin.resize(tool.mesh().vertices.size());
    if (!moment.skin.empty()) {
        tool.vertices(moment.skin);
    }
    moment.spheres.clear();
    moment.contacts.clear();
    for (const ToolProxy& proxy : tool.particles()) {
        moment.spheres.push_back({proxy.position, proxy.radius, proxy.in_contact()});
        // A plane touches the sphere at the point opposite to its normal.
        for (std::size_t k = 0; k < proxy.contacts.count; ++k) {
            const Vec3 point = proxy.position - proxy.radius * proxy.contacts.plane[k].normal;
            moment.contacts.push_back({point, kMarkSize * proxy.radius, true});
        }
    }
}

PictureObject skin_object(const ToolProxies& tool, const std::vector<Vec3>& vertices) {
    PictureObject skin{.vertices = vertices, .triangles = tool.mesh().triangles, .closed = true, .colour = kSkinColour};
    skin.tool = true;
    return skin;
}

ToolPicture tool_picture(const SceneRun& run, const std::string& title, ToolStyle style) {
    const ToolProxies& tool = run.simulation().tool();
    ToolPicture picture;
    picture.scene = run.picture(title);
    picture.scene.proxy_radius = 0.0;
    picture.tool = tool.vertices();
    picture.device = tool.goal_vertices();
    // The skin of the tool, transparent if its spheres are shown.
    PictureObject skin = skin_object(tool, picture.tool);
    skin.ghost = style == ToolStyle::Spheres;
    picture.scene.objects.push_back(std::move(skin));
    // The proxies, or the skin at the device's pose.
    if (style == ToolStyle::Spheres) {
        for (const ToolProxy& proxy : tool.particles()) {
            picture.scene.spheres.push_back({proxy.position, proxy.radius, proxy.in_contact()});
        }
    } else if (run.result().in_contact) {
        picture.scene.objects.push_back(
            {.vertices = picture.device, .triangles = tool.mesh().triangles, .closed = true, .ghost = true});
    }
    return picture;
}

}  // namespace haptic::sim::reproduce
