"""The fields of Webots' nodes and of the PROTOs that the reader models.

Sources: Webots' `resources/nodes/*.wrl` and PROTO files in several versions between
R2019a and R2025a. A list has the fields, also hidden and deprecated ones, of all of
them, and some of older and unreleased versions. Nodes that are not listed are not
checked.
"""

from __future__ import annotations

_POSE = "translation rotation children translationStep rotationStep"
_SOLID = (
    f"{_POSE} name model description contactMaterial immersionProperties "
    "boundingObject physics locked radarCrossSection recognitionColors linearVelocity "
    "angularVelocity"
)
_AXES = "lookupTable xAxis yAxis zAxis resolution"
_LIGHT = "ambientIntensity color intensity on castShadows"
_LAMP = f"{_LIGHT} attenuation location radius"
_MOTOR = (
    "name acceleration consumptionFactor controlPID controlP controlI controlD "
    "maxVelocity minPosition maxPosition multiplier sound muscles"
)
_JOINT = (
    "position axis minStop maxStop springConstant dampingConstant staticFriction anchor"
)
_ROUND = "bottom side top height radius subdivision"
_SIDES = ("back", "bottom", "front", "left", "right", "top")
_LENS = "fieldOfView width height near far spherical projection motionBlur noise lens"
_SCREEN = "windowPosition pixelSize"
_ROBOT = (
    f"{_SOLID} controller controllerArgs customData supervisor synchronization battery "
    "cpuConsumption selfCollision window showWindow remoteControl data"
)
_ARENA = (
    "contactMaterial floorAppearance floorTileSize wallThickness wallHeight "
    "wallAppearance floorTextureUrl wallTextureUrl wallColor wallTileSize"
)

_PLAIN = {
    "Appearance": "material texture textureTransform name",
    "Background": "skyColor luminosity cubemap "
    + " ".join(f"{side}Url {side}IrradianceUrl" for side in _SIDES),
    "BallJoint": "jointParameters jointParameters2 jointParameters3 device device2 "
    "device3 endPoint position position2 position3",
    "BallJointParameters": _JOINT,
    "Billboard": "children",
    "Box": "size",
    "Capsule": _ROUND,
    "Cone": "bottomRadius height side bottom subdivision",
    "ContactProperties": "material1 material2 coulombFriction frictionRotation "
    "rollingFriction bounce bounceVelocity forceDependentSlip softERP softCFM "
    "bumpSound rollSound slideSound maxContactPoints maxContactJoints",
    "Coordinate": "point",
    "Cylinder": _ROUND,
    "Damping": "linear angular",
    "DirectionalLight": f"{_LIGHT} direction castLensFlares",
    "ElevationGrid": "height thickness color colorPerVertex xDimension xSpacing "
    "yDimension ySpacing zDimension zSpacing",
    "Fog": "color fogType visibilityRange",
    "Group": "children",
    "Hinge2Joint": "jointParameters jointParameters2 device device2 endPoint position "
    "position2",
    "HingeJoint": "jointParameters device endPoint position",
    "HingeJointParameters": f"{_JOINT} suspensionSpringConstant "
    "suspensionDampingConstant suspensionAxis stopERP stopCFM",
    "ImageTexture": "url repeatS repeatT filtering",
    "IndexedFaceSet": "coord normal texCoord ccw convex solid normalPerVertex "
    "coordIndex normalIndex texCoordIndex creaseAngle",
    "JointParameters": _JOINT,
    "LinearMotor": f"{_MOTOR} maxForce",
    "Material": "ambientIntensity diffuseColor emissiveColor shininess specularColor "
    "transparency",
    "Mesh": "url ccw name materialIndex",
    "PBRAppearance": "baseColor baseColorMap transparency roughness roughnessMap "
    "metalness metalnessMap environmentMap IBLStrength normalMap normalMapFactor "
    "occlusionMap occlusionMapStrength emissiveColor emissiveColorMap "
    "emissiveIntensity textureTransform name",
    "Physics": "density mass centerOfMass inertiaMatrix damping orientation",
    "Plane": "size",
    "PointLight": _LAMP,
    "Pose": _POSE,
    "PositionSensor": "name noise resolution",
    "RotationalMotor": f"{_MOTOR} maxTorque",
    "Shape": "appearance geometry castShadows isPickable",
    "SliderJoint": "jointParameters device endPoint position",
    "Slot": "type endPoint",
    "Sphere": "radius subdivision ico",
    "SpotLight": f"{_LAMP} beamWidth cutOffAngle direction",
    "TextureCoordinate": "point",
    "TextureTransform": "center rotation scale translation",
    "Transform": f"{_POSE} scale",
    "Viewpoint": "fieldOfView orientation position description near far exposure "
    "follow followType followOrientation followSmoothness lensFlare "
    "ambientOcclusionRadius bloomThreshold",
    "WorldInfo": "info title window gravity CFM ERP physics basicTimeStep FPS "
    "optimalThreadCount physicsDisableTime physicsDisableLinearThreshold "
    "physicsDisableAngularThreshold defaultDamping inkEvaporation magneticField "
    "coordinateSystem gpsCoordinateSystem gpsReference lineScale randomSeed "
    "contactProperties northDirection fast2d displayRefresh dragForceScale "
    "dragTorqueScale",
}
_SOLIDS = {
    "Accelerometer": _AXES,
    "Altimeter": "accuracy resolution",
    "Camera": f"{_LENS} {_SCREEN} exposure antiAliasing ambientOcclusionRadius "
    "bloomThreshold noiseMaskUrl focus zoom recognition lensFlare type colorNoise "
    "rangeNoise rangeResolution maxRange",
    "Compass": _AXES,
    "Display": f"width height {_SCREEN}",
    "DistanceSensor": "lookupTable type numberOfRays aperture gaussianWidth resolution "
    "redColorSensitivity",
    "Emitter": "type range maxRange aperture channel baudRate byteSize bufferSize "
    "allowedChannels",
    "GPS": "type accuracy noiseCorrelation resolution speedNoise speedResolution",
    "Gyro": _AXES,
    "InertialUnit": f"{_AXES} noise",
    "LED": "color gradual",
    "Lidar": "tiltAngle horizontalResolution fieldOfView verticalFieldOfView "
    "numberOfLayers near minRange maxRange type projection noise resolution "
    "defaultFrequency minFrequency maxFrequency rotatingHead spherical motionBlur",
    "LightSensor": "lookupTable colorFilter occlusion resolution",
    "Pen": "inkColor inkDensity leadSize maxDistance write",
    "RangeFinder": f"{_LENS} {_SCREEN} minRange maxRange resolution",
    "Receiver": "type aperture channel baudRate byteSize bufferSize allowedChannels "
    "signalStrengthNoise directionNoise",
    "Robot": _ROBOT,
    "Solid": "",
    "Speaker": "",
    "Supervisor": _ROBOT,
    "TouchSensor": "type lookupTable resolution",
}
_PROTOS = {
    "Ball": "color radius mass centerOfMass linearDamping angularDamping "
    "contactMaterial",
    "BeerBottle": "mass",
    "Can": "color textureUrl mass",
    "CardboardBox": "size mass locked lidAngle",
    "Cat": "scale color mass enablePhysics",
    "CerealBox": "size mass textureUrl physics",
    "CircleArena": f"{_ARENA} radius subdivision",
    "Dog": "scale color mass enablePhysics",
    "E-puck": "controller controllerArgs customData supervisor synchronization version "
    "camera_fieldOfView camera_width camera_height camera_antiAliasing camera_rotation "
    "camera_noise camera_motionBlur distance_sensor_numberOfRays emitter_channel "
    "receiver_channel battery window turretSlot groundSensorsSlot kinematic "
    "selfCollision",
    "Floor": "contactMaterial size tileSize appearance texture",
    "HoneyJar": "mass textureLidUrl color",
    "JamJar": "mass textureLidUrl",
    "MazeBlock": "length",
    "Obstacle": "color",
    "OilBarrel": "height radius physics immersionProperties",
    "PingPongBall": "immersionProperties textureUrl",
    "PlasticCrate": "size color mass",
    "RectangleArena": f"{_ARENA} floorSize",
    "Rock": "scale type color texture physics",
    "SoccerBall": "radius mass",
    "SolidBox": "size contactMaterial appearance physics castShadows "
    "enableBoundingObject",
    "SolidPipe": "height radius thickness subdivision accuracy contactMaterial "
    "appearance physics enableBoundingObject",
    "TrafficCone": "scale physics",
    "Wall": "size appearance",
    "WaterBottle": "textureUrl mass",
    "WoodenBox": "size mass locked immersionProperties",
    "WoodenPallet": "size lathNumber lathWidth mass boundingObject locked",
    "YoubotFlag": "textureURL",
}
_EVERY_PROTO = "translation rotation name recognitionColors locked"

KNOWN: dict[str, frozenset[str]] = {
    **{kind: frozenset(own.split()) for kind, own in _PLAIN.items()},
    **{kind: frozenset(f"{_SOLID} {own}".split()) for kind, own in _SOLIDS.items()},
    **{
        kind: frozenset(f"{_EVERY_PROTO} {own}".split())
        for kind, own in _PROTOS.items()
    },
}
"""Names of the fields of each type."""
LOST_SCALE = frozenset({"Pose", *_SOLIDS})
"""Types without a field `scale` since R2023b; before, all but Pose had it."""
GAINED_SCALE = frozenset({"TrafficCone"})
"""Types with a field `scale` since R2023b."""
